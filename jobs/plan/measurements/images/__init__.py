"""Images of the truth, which other measurements read."""
