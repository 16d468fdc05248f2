"""Images of the truth, which other measurements read, and live pages of a fabric."""
