"""The front of two costs, such as time and error: the points that nothing beats on both.

A point is beaten by another that is nowhere worse and somewhere better. Equal points do not beat each other; what was
not measured takes no part.
"""

from __future__ import annotations

import math
from collections.abc import Sequence


def front(points: Sequence[tuple[float, float]]) -> list[bool]:
    """Return which points are on the front.

    Parameters
    ----------
    points : sequence of (float, float)
        Time and error; less is better. Points with NaN or infinity are not on the front and beat nothing.

    Returns
    -------
    list of bool
    """
    on = [False] * len(points)
    measured = sorted((point, index) for index, point in enumerate(points) if all(map(math.isfinite, point)))
    last, lowest = (math.nan, math.nan), math.inf
    # From the fastest on: whatever is not better than all faster ones is beaten by one of them, or equals it.
    for point, index in measured:
        if point[1] < lowest or point == last:
            on[index], last, lowest = True, point, point[1]
    return on
