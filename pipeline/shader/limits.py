"""Limits of the shader: larger cloth is refused."""

from typing import Final

MOST_NODES: Final = 1024  # most fixed nodes of a table, those that fill up blocks included
MOST_REPEAT_CELLS: Final = 1024  # most cells of a repeat, ends times picks

MOST_HEIGHT: Final = 8192
"""Most rows of a texture, of TEXTURE_WIDTH horizons in a grid. Every WebGL 2 allows 2048, which the front alone never
exceeds; graphics processors allow 8192 and more."""
