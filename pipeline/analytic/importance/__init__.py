"""Importance sampling of the light scattered by a footprint, with exact densities: surface, lobes, mixture."""
