"""The estimators `node_table` and `auto`: sums over tabulated nodes with exact horizons.

build makes the nodes, tables keeps them for the last cloths; weights spreads a footprint over them, kernels are the
loops over nodes, shares their arrays. answer sums, refine samples nodes on borders of shadows, cascade is `auto`: a
coarse table, a fine one, sampling.
"""
