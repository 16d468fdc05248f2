"""Which points of the repeat a footprint covers: place, masses, mixture (rotated ellipses), sequences."""
