"""`map_material`: texture maps of `twillight export --maps`, evaluated as a renderer does."""
