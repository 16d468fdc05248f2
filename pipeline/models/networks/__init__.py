"""Layers, losses and textures that several networks share."""
