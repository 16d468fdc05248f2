"""Draft files of weaving programs: reading, fabrics from them, and writing."""
