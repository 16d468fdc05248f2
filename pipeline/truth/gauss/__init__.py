"""Gauss-Legendre quadrature of the patch integral with few nodes, in single precision."""
