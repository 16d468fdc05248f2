"""The reference answer to a patch query, and its error; nothing else.

conventions and options state the definitions. query and cloth are the input, estimator is the entry point. geometry
(shadows: geometry.visibility), scattering and footprint describe one point of the cloth; monte_carlo, quadrature and
node_table integrate points over a footprint; calibration gives their errors one meaning; invariants tests physical
invariants. Approximations are in pipeline.analytic.
"""
