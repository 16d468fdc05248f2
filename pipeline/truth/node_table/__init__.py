"""The estimators `node_table` and `auto`: sums over tabulated nodes with exact horizons.

tables keeps the nodes of the last cloths; build makes them. answer sums over nodes for each query. doubts says which
nodes may be wrong, refine integrates those. weights spreads a footprint over nodes; walls are what view rays meet
where yarns end in a step, seen_walls sums over them. kernels has the loops over nodes.
"""
