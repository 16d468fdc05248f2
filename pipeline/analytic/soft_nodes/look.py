"""One query as the sums take it: its footprint within the repeat, its directions, and the azimuths around them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Look(NamedTuple):
    """A query.

    Attributes
    ----------
    x, y : float64
        Centre of the footprint, within the repeat.
    dx, dy, rho, narrowest : float32
        Deviations along x and y in yarn spacings, correlation of the axes, and the least deviation of any direction.
    ix, iy, iz, ox, oy, oz : float32
        wi and wo.
    low_i, high_i, turn_i, low_o, high_o, turn_o
        Azimuths around wi and wo, and where between them these lie.
    bend_i, bend_o : float32
        Curvatures of the cloth towards wi and wo, 1/yarn spacings.
    """

    x: float
    y: float
    dx: np.float32
    dy: np.float32
    rho: np.float32
    narrowest: np.float32
    ix: np.float32
    iy: np.float32
    iz: np.float32
    ox: np.float32
    oy: np.float32
    oz: np.float32
    low_i: int
    high_i: int
    turn_i: np.float32
    low_o: int
    high_o: int
    turn_o: np.float32
    bend_i: np.float32
    bend_o: np.float32
