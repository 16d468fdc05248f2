"""Rows of the scratch in which points are passed, float32 (ROWS, N) and int32 (INTEGERS, N)."""

from __future__ import annotations

from typing import Final

ROWS: Final = 26
"""Rows of numbers."""

# Inputs: position in the repeat and weight; directions of the query, 1 / |wi + wo|^2, where between two azimuths they
# lie. Then the results of `locate`, and the shares that `shade` writes.
(X, Y, WEIGHT, IX, IY, IZ, OX, OY, OZ, SIZE, TURN_I, TURN_O, SINE, DISTANCE, CURVATURE, LIMIT, WARPNESS, WEFTNESS,
 SEEN, BOTH, STEP_V, STEP_Y, STEEPNESS, AREA, DIFFUSE, SPECULAR) = range(ROWS)  # fmt: skip

INTEGERS: Final = 5
"""Rows of integers."""

# The azimuths' rows around wi and wo, and the node.
I0, I1, O0, O1, NODE = range(INTEGERS)
