import numpy as np
import pytest

from pipeline.analytic.horizon_points import horizon_map as maps
from pipeline.analytic.horizon_points.shading import fill_points, query_rows, shade, uncover
from pipeline.truth.geometry.heightfield import height_field
from tests.pipeline.truth.cloths import woven

COUNT = 1500

RTOL = 1e-4
"""Some forty roundings of 6e-8, and ten times that where a highlight's narrow denominator is a small difference."""


def cloth(name, **changes):
    return woven(name, **changes).model_copy(update={"optical_thickness": 0.4})


@pytest.mark.parametrize(
    "fabric",
    [cloth("denim", relief=1.2, twist=30.0), cloth("silk_charmeuse"), cloth("cotton_twill", width=0.7)],
    ids=["twist and relief", "lustrous", "gaps"],
)
@pytest.mark.parametrize(
    ("wi", "wo"), [((0.3, -0.4, 0.866), (0.1, 0.6, 0.794)), ((-0.7, 0.3, 0.648), (-0.6, 0.5, 0.6245))]
)
def test_every_point_is_the_point_model(point_shares, fabric, wi, wo):
    """No box around a point: a highlight has one place there."""
    wi, wo = (np.array(w, np.float32) / np.float32(np.linalg.norm(w)) for w in (wi, wo))
    ends, picks = fabric.weave.repeat
    field = height_field(fabric)
    table = maps.horizon_map(field, field, 4, 8)
    # Horizons below every direction: nothing is hidden.
    table = table._replace(horizon=np.full_like(table.horizon, -2.0))
    random = np.random.default_rng(6)
    points, places = np.zeros((maps.SCRATCH_ROWS, COUNT), np.float32), np.zeros((maps.INTEGERS, COUNT), np.int32)
    points[maps.X], points[maps.Y] = random.random(COUNT) * ends, random.random(COUNT) * picks
    points[maps.WEIGHT], points[maps.STEEPNESS] = 1.0, 1e9
    values, rows = np.zeros((9, 1), np.float32), np.zeros((4, 1), np.int32)
    query_rows(wi, wo, table.azimuths, table.grid**2, values, rows, 0)
    fill_points(points, places, values, rows, 1, COUNT)
    maps.locate(table, COUNT, points, places)
    uncover(table.horizon, COUNT, points, places)
    shade(table, COUNT, points[maps.WEIGHT], points)

    area, specular, diffuse = point_shares(fabric, points[maps.X], points[maps.Y], wi, wo)
    family = np.where(points[maps.WARPNESS] > 0, 0, np.where(points[maps.WEFTNESS] > 0, 1, 2))
    assert (area[np.arange(COUNT), family] > 0).mean() > 0.5
    # Next to the edge of a yarn a point's own rounding turns the normal by more than the tolerance.
    inner = np.abs(points[maps.SINE]) < 0.98
    for row, expected in ((maps.AREA, area), (maps.SPECULAR, specular), (maps.DIFFUSE, diffuse)):
        expected = expected.sum(axis=1)
        np.testing.assert_allclose(points[row][inner], expected[inner], rtol=RTOL, atol=1e-6 * expected.max())
