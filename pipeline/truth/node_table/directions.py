"""Light and viewer of a query as the loops over nodes read them: numbers in single precision."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float64
from pipeline.compiled.decorators import kernel
from pipeline.truth.geometry.azimuths import azimuth_rows

_STEEPEST = 1e4


class Direction(NamedTuple):
    """A unit direction, and where horizons towards it stand in a table.

    Attributes
    ----------
    x, y, z : float32
        Components.
    slope : float32
        Rise per unit of distance in the fabric plane.
    first, second : int
        The two azimuths of the table around it.
    turn : float32
        Its place between them, 0 to 1.
    """

    x: np.float32
    y: np.float32
    z: np.float32
    slope: np.float32
    first: int
    second: int
    turn: np.float32


class NodeDirections(NamedTuple):
    """Directions of one query.

    Attributes
    ----------
    behind : bool
        Whether the light is behind the cloth.
    light : Direction
        wi; of light from behind the components of -wi, but slope and azimuths of wi reflected in the fabric plane.
    viewer : Direction
        wo.
    through : Direction
        -wo reflected in the fabric plane: the way through a gap, as the back of the cloth sees it.
    size : float32
        1 / |wi + wo|^2.
    """

    behind: bool
    light: Direction
    viewer: Direction
    through: Direction
    size: np.float32


@kernel
def node_directions(wi: Float64, wo: Float64, azimuths: int) -> NodeDirections:
    """Prepare unit directions, wo with z > 0, for a table with so many azimuths."""
    behind = wi[2] < 0.0
    sign = -1.0 if behind else 1.0
    half = (wi[0] + wo[0]) ** 2 + (wi[1] + wo[1]) ** 2 + (wi[2] + wo[2]) ** 2
    first, second, turn = azimuth_rows(wi[0], wi[1], azimuths)
    light = Direction(
        np.float32(sign * wi[0]),
        np.float32(sign * wi[1]),
        np.float32(sign * wi[2]),
        _slope(wi),
        first,
        second,
        np.float32(turn),
    )
    x, y, z, slope = np.float32(wo[0]), np.float32(wo[1]), np.float32(wo[2]), _slope(wo)
    first, second, turn = azimuth_rows(wo[0], wo[1], azimuths)
    viewer = Direction(x, y, z, slope, first, second, np.float32(turn))
    first, second, turn = azimuth_rows(-wo[0], -wo[1], azimuths)
    through = Direction(-x, -y, z, slope, first, second, np.float32(turn))
    return NodeDirections(behind, light, viewer, through, np.float32(1.0 / max(half, 1e-12)))


@kernel
def _slope(w: Float64) -> np.float32:
    """Return the rise of a direction, on either side of the cloth, bounded."""
    return np.float32(min(abs(w[2]) / max(math.sqrt(w[0] * w[0] + w[1] * w[1]), 1e-9), _STEEPEST))
