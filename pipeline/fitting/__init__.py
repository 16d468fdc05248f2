"""A fabric from what was measured on a cloth."""
