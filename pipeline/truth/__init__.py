"""Ground truth: the point model, visibility, and the Monte Carlo integration of patches."""
