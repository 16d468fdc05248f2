"""A fabric as files for other programs: `export` writes any kind, by name.

Drafts, `mesh` (triangles) and `maps` (textures) with their `materials` are written here, shaders by pipeline.shader and
pages by reports.viewer.
"""
