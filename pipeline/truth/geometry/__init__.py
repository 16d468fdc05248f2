"""Geometry of one repeat: heightfield (surface), visibility (shadows and masking), horizon, opacity.

horizon tabulates visibility; opacity is that of curved cloth. pieces and symmetry find the different parts of a repeat;
gloss varies the specular colour from float to float; march and azimuths are shared helpers.
"""
