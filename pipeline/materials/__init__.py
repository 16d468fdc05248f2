"""Texture maps of a fabric for programs that know materials, not yarns.

planes (layout of a map, sums of the surface over its texels, mip levels), lobes (what the truth returns of an even sky;
GGX and Charlie sheen), textures (the maps), lookup (a material of maps, evaluated). No files are written here.
"""
