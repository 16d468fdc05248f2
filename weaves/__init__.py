"""Woven cloth: drafts, yarns, fabrics and the geometry of their repeat; no light."""
