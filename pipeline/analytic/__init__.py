"""Approximations of the patch integral that learn nothing: the rivals of trained models.

soft_nodes and gauss_nodes sum over few nodes with softened horizons; horizon_points samples points with a horizon map;
exact_points samples points with exact shadows; prefiltered averages normals; importance draws directions.
Shared parts: columns (queries in single precision), torus_frame, flakes_float32, gauss_rules,
soft_horizons, axis_densities. Ground truth never imports this package.
"""
