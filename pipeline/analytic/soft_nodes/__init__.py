"""Soft nodes: sums over few nodes with softened horizons, a patch BSDF to a few per cent in about a microsecond.

nodes: the table of a cloth, at a level of detail; groups and waves make it. answer: the sums of queries; wide for
fixed nodes; narrow, footprint_nodes and ellipse_nodes for nodes placed in the footprint; shade for
both. features: input of the network `selvage`, and components of light from both sides.
"""
