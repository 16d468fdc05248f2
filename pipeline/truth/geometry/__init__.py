"""Geometry of one repeat: heightfield (surface), visibility (shadows and masking), horizon, opacity.

horizon tabulates visibility; opacity is that of curved cloth. pieces finds the different parts of a repeat; march is
shared by all rays.
"""
