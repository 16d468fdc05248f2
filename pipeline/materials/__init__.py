"""Texture maps of a fabric for programs that know materials, not yarns.

layout (yarns and texels of a map), planes (sums of the surface over texels, and their mip levels), reflectance (what
the truth returns of an even sky), lobes (GGX and Charlie sheen), textures (the maps). No files are written here.
"""
