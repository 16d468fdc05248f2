"""Points of the repeat under a footprint, and their weights: place, masses, mixture (rotated ellipses), sequences."""
