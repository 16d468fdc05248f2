import math

import numpy as np
import pytest

from pipeline.analytic.bounces.walks import _gap_points, _see_gaps, starting_points, transport
from pipeline.truth.geometry.heightfield import height_field
from pipeline.truth.geometry.pieces import different_cells
from tests.directions import sphere, unit
from tests.pipeline.truth.cloths import LOPSIDED, cylinders, woven
from weaves.count import cover
from weaves.draft import Draft, Matrix

CLOSED = woven("silk_charmeuse", width=1.0, blend=1.0)


MANY = Matrix(rows=tuple(Draft(np.random.default_rng(1).random((64, 48)) < 0.5).rows()))


@pytest.mark.parametrize(
    "fabric",
    [LOPSIDED, woven("satin_8"), woven("voile"), woven("voile").model_copy(update={"draft": MANY})],
    ids=["narrow", "satin", "open", "many cells"],
)
def test_starting_points_cover_what_is_seen_from_above(fabric):
    """Their areas sum to the plane less the gaps, of one cell of each kind, also where only some cells are chosen."""
    field = height_field(fabric)
    start = starting_points(field, 4096)
    gap = cover(fabric.warp, fabric.weft).openness
    assert start.area.sum() == pytest.approx(different_cells(field) * (1.0 - gap), rel=2e-3)
    assert _gap_points(field, 4096)[2].sum() == pytest.approx(different_cells(field) * gap)


def test_gaps_count_where_neither_face_hides_them_and_close_at_the_cut_off_angle(monkeypatch):
    """Straight elliptical yarns of width .6 hide .6 sqrt(cos^2 + .8^2 sin^2) / cos of what lies between them."""
    fabric = woven("gauze", bend=2.0, relief=0.8)
    closed, faces = cover(fabric.warp, fabric.weft), (height_field(fabric), height_field(fabric.back()))
    for angle, azimuth in ((closed.cut_off_along_warp, 90.0), (closed.cut_off_along_weft, 0.0)):
        viewers, seen = np.array([unit(share * angle, azimuth) for share in (0.0, 0.8, 0.9, 1.03)]), np.zeros(4)
        _see_gaps(*faces, *_gap_points(faces[0], 1 << 14), viewers, seen)
        cosine = viewers[:, 2]
        hidden = np.minimum(0.6 * np.sqrt(cosine**2 + 0.64 * (1.0 - cosine**2)) / cosine, 1.0)
        passed = seen / cosine / different_cells(faces[0])
        np.testing.assert_allclose(passed, (1.0 - hidden) * 0.4, atol=0.006)
        assert passed[0] == pytest.approx(closed.openness) and passed[2] > 0.0 == passed[3]
    # From straight above all of them: what is seen is the plane. At 85 degrees yarns hide all gaps.
    fabric = woven("gauze")
    asked = height_field(fabric), 1 << 10, np.array([unit(0, 0), unit(85, 0), unit(85, 90)]), unit(0, 0)[None]
    sums = transport(*asked)
    monkeypatch.setattr("pipeline.analytic.bounces.walks.cores", lambda: 1)
    assert all(map(np.array_equal, sums, transport(*asked))), "no bit depends on the number of threads"
    field = height_field(fabric)
    start = starting_points(field, 1 << 10)
    assert sums.seen[0] - start.area.sum() == pytest.approx(0.16 * different_cells(field), rel=2e-2)
    assert (sums.seen[1:] < 2.0 * math.cos(math.radians(85.0)) * different_cells(field)).all()


def test_round_yarns_side_by_side_give_each_other_what_lines_of_sight_say():
    """Cylinders of diameter 1: from a point at the angle v, the neighbour fills angles from its tangent line down. Of
    what a point sends across, the share between two angles to its normal is half the difference of their sines. What
    reaches the neighbour leaves the cloth, or reaches another yarn."""
    sine = (np.arange(4000) + 0.5) / 2000 - 1.0
    v = np.arcsin(sine)
    x, y = 1.0 - 0.5 * sine, -0.5 * np.cos(v)
    upper = np.arctan2(y, x) + np.arcsin(0.5 / np.hypot(x, y))
    expected = 2.0 * np.mean(0.5 * (1.0 - np.sin(np.minimum(0.5 * math.pi - v - upper, 0.5 * math.pi))))
    above = sphere(32, 32)
    above = above[above[:, 2] > 0.0]
    sums = transport(height_field(cylinders(blend=1.0)), 1 << 14, unit(0, 0)[None], above)
    leaves = sums.second[0].sum() * 2.0 * math.pi / len(above)
    assert (leaves + sums.reached[0].sum()) / sums.seen[0] == pytest.approx(expected, rel=0.02)


def test_light_takes_each_way_in_both_directions_and_leaves_where_it_is_not_sent_on():
    """Lambertian yarns without walls, of which viewers see nothing: sun and viewer may change places."""
    ways = np.array([unit(*angles) for angles in ((20, 40), (55, 130), (70, 300), (40, 200))])
    sums = transport(height_field(cylinders(blend=1.0)), 1 << 16, ways, ways)
    there, back = sums.second, sums.second.transpose(3, 2, 1, 0)
    assert np.linalg.norm(there - back) < 0.03 * np.linalg.norm(there)
    # White closed cloth: of what comes from third yarns, the share that leaves and the share that goes on are 1.
    above = sphere(16, 16)
    above = above[above[:, 2] > 0.0]
    sums = transport(height_field(CLOSED), 1 << 16, above[:1], above)
    count = sums.later[:, -1]
    leaves = sums.later[:, :-1].sum(axis=1) * 2.0 * math.pi / len(above)
    known = count > 0.02 * count.sum()
    assert (leaves + sums.transfers.sum(axis=1))[known] == pytest.approx(count[known], rel=0.03)
