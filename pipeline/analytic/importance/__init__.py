"""Importance sampling of the light scattered by a footprint, with exact densities: lobes, mixture."""
