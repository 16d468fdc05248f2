"""The point model in double precision with shadows off: the oracle of every kernel in single precision."""

import numpy as np
import pytest

from pipeline.truth.geometry.heightfield import GAP, height_field
from pipeline.truth.scattering.point import Choices, directions_of, point_share

ALONE = Choices(macro=False, shadows=False)


def _shares(fabric, x, y, wi, wo):
    """Return area, specular, diffuse of warp, weft and gaps (by columns 0 to 2), each (N, 3), at points of the repeat.
    `wi` and `wo` are one direction, or one for each point."""
    front = height_field(fabric)
    found = np.zeros((3, len(x), 3))
    for k, at in enumerate(zip(np.asarray(x, np.float64), np.asarray(y, np.float64), strict=True)):
        i, o = (np.broadcast_to(w, (len(x), 3))[k].astype(np.float64) for w in (wi, wo))
        family, area, specular, diffuse, _ = point_share(front, front, *at, directions_of(*i, *o, 0.0), ALONE)
        found[:, k, family] = area, specular, diffuse
    assert not found[1:, :, GAP].any()
    return found


@pytest.fixture(scope="session")
def point_shares():
    return _shares
