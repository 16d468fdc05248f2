"""Soft nodes: sums over few nodes with softened horizons, a patch BSDF to a few per cent in about a microsecond.

nodes: the table of a cloth; groups, surface and waves make it. answer: the sums of queries; weights and shade for fixed
nodes; footprint_nodes, ellipse_nodes and shade for nodes placed in the footprint. features: input of the network
`selvage`. behind: light from behind, and transparency.
"""
