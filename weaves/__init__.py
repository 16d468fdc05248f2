"""What the cloth is: drafts, yarns, fabrics and the geometry of their repeat."""
