"""Soft nodes: sums over few nodes with softened horizons, a patch BSDF of view rays to a few per cent in microseconds.

nodes: the table of a cloth, at a level of detail; groups and seen_areas make it. answer: the sums of queries; wide for
fixed nodes; view_lines for nodes placed on lines in the viewer's azimuth, where view_rays says what is seen of each
piece, and line_nodes sums them; shade for both. components: what is read of the sums, light in front or behind.
"""
