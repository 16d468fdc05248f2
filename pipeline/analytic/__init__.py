"""Approximations of the patch integral that learn nothing: the rivals of trained models.

soft_nodes sums over few nodes with softened horizons; exact_points samples points with exact shadows; prefiltered
averages normals; importance draws directions. Shared parts: torus_frame, gauss_rules, soft_horizons; coverage of curved
cloth is of all of them.
The ground truth never imports this package.
"""
