"""`point_sampled`: the point model at k points of the footprint."""
