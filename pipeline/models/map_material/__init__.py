"""`map_material`: the texture maps that `twillight export --maps` writes, evaluated as a renderer does."""
