"""Gauss-Legendre nodes on every piece of yarn, k across it, with softened horizons, in single precision."""
