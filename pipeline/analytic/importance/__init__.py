"""Directions drawn from what a footprint scatters, with their exact density: point, lobes."""
