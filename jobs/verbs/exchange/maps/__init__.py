"""`twillight export FABRIC --maps FOLDER`: texture maps and materials for programs with texture slots.

export_maps (the verb), catalogue (the maps and what they mean), about (the JSON file beside them), openpbr (the
MaterialX document), sample (the draped sample as GLB).
"""
