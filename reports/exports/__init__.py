"""A fabric as files for other programs: `export` writes any kind, by name.

Drafts, `bsdf` (for daylight simulation), `mesh` (triangles) and `maps` (textures) with their `materials` are written
here, shaders by pipeline.shader and pages by reports.viewer.
"""
