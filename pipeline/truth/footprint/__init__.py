"""Points of the repeat under a footprint, and their weights: place, mixture (rotated ellipses), sequences."""
