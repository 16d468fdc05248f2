"""`soft_nodes`: sums over few nodes with softened horizons; nothing is learnt."""
