"""Importance sampling of the light scattered by a footprint, with exact densities: point, surface, lobes, mixture."""
