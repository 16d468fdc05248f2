"""The estimators `table` and `auto`: sums over tabulated nodes with exact horizons, and what they cannot answer.

build makes the nodes, weights spreads a footprint over them, kernels are the flat loops, answer sums, refine samples
doubtful nodes again, cascade is `auto`: coarse table, fine table, sampling.
"""
