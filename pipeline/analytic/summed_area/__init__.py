"""Tables of the visible area of clusters of yarn, summed over footprints; ours after the idea of Zhu et al. (2024).

clusters groups the surface, tables sums it over Gaussians of several levels, shade evaluates the point model once a
cluster, answer reads the tables for a query.
"""
