import math

import numpy as np
import pytest

from pipeline.truth.calibration import REFINED
from pipeline.truth.cloth import AREA_SUM, POINT_SUMS, cloth_side, columns_of
from pipeline.truth.estimator import uncalibrated
from pipeline.truth.monte_carlo import add_point, query_directions
from pipeline.truth.node_table.doubts import doubtful_from, no_doubts
from pipeline.truth.node_table.kernels import no_shares
from pipeline.truth.node_table.refine import Known, Row, add_row, refine_room
from pipeline.truth.node_table.tables import FINE
from pipeline.truth.options import TruthOptions
from tests.pipeline.truth.cloths import drawn, fixed
from tests.presets import slow
from weaves.fabric import load_fabric

EVERYWHERE = Known(False, False, False)
EVERY_PLACE = Known(False, False, True)


def mean_of_points(cloth, directions, x, y, size, tilt):
    sums = np.zeros((1, POINT_SUMS))
    for u in (np.arange(40) + 0.5) / 40:
        for v in (np.arange(40) + 0.5) / 40:
            add_point(cloth, x + u * size, y + v * size, 1.0 + tilt * (u - 0.5), directions, sums, 0)
    return sums[0] / 1600


@pytest.mark.parametrize(
    ("name", "behind", "count"), [("denim", 0.0, 12), slow("gauze", 0.0, 30), slow("gauze", 1.0, 30)]
)
def test_cut_rows_are_unbiased(name, behind, count):
    """Rows at random heights of a square of the fabric that borders cross agree with its points; half a node wide."""
    fabric = load_fabric(name)
    cloth = cloth_side(fabric, TruthOptions(parallax=False))
    columns, room, size, tilt = columns_of(drawn(fabric, 61, count, behind=behind)), refine_room(1), 1.0 / 64, 0.6
    randoms = {known: np.random.default_rng(3) for known in (EVERYWHERE, EVERY_PLACE)}
    scores, crossed = {known: [] for known in randoms}, dict.fromkeys(randoms, 0)
    for row in range(count):
        directions = query_directions(columns, row)
        x, y = (math.floor(64 * place) / 64 for place in (columns.u[row] % 1, columns.v[row] % 1))
        exact = mean_of_points(cloth, directions, x, y, size, tilt)
        for known, random in randoms.items():
            values = []
            for k in range(64):
                height, offset = (k + random.random()) / 64, random.random()
                add_row(cloth, directions, Row(x, y + height * size, size, 0.0, offset, 1.0, tilt), known, room)
                values.append(room.value.copy())
            mean, spread = np.mean(values, axis=0), np.std(values, axis=0) / 8
            for q in (0, 1, 2, 3, AREA_SUM):
                crossed[known] += spread[q] > 0.01 * abs(mean[q])
                # A point more or less on either side of a border: the squares of points are no closer.
                allowed = 4 * spread[q] + 0.02 * abs(exact[q])
                scores[known].append(abs(mean[q] - exact[q]) <= allowed)
    assert min(crossed.values()) >= 3
    assert min(map(np.mean, scores.values())) > 0.98


def test_nodes_that_are_left_keep_a_share_of_the_requested_error():
    """Two nodes of a row differ; a small requested error selects both, a large one neither."""
    fabric = load_fabric("denim")
    table = FINE.table(cloth_side(fabric, TruthOptions()), False)
    shares, doubts = no_shares(table.normal.shape[1]), no_doubts(table.normal.shape[1])
    shares.weight[:] = table.evenly
    shares.areas[:], shares.margins[:], shares.lit_margins[:] = table.evenly, 1.0, 1.0
    shares.diffuses[:] = table.evenly
    # In shade from here on, without warning: the border's place is unknown.
    first = int(table.pieces[0, 0])
    dark = first + 5 * int(table.pieces[0, 1]) + 7
    shares.lit_margins[dark], shares.diffuses[dark] = -1.0, 0.0
    mean, below = np.zeros(5), float(shares.areas.sum())
    mean[2:4] = 0.5 / math.pi
    change = float(table.evenly[dark]) / math.pi / below
    for requested, refined in ((1e-3 * change, True), (1e3 * change, False)):
        least = doubtful_from(table, shares, mean, below, requested**2, doubts)
        assert (doubts.score[dark] >= least) == refined
        kept = doubts.score[doubts.score < least].astype(np.float64).sum()
        assert kept <= 0.35 * (requested * below) ** 2
        assert doubts.left[0] == pytest.approx(kept, rel=1e-4, abs=1e-300)


@pytest.mark.parametrize(("parallax", "sigma", "angle"), [(True, (0.3, 2.0), 60.0), (False, (0.05, 0.5), 89.0)])
def test_refined_answers_are_closer_than_the_table(parallax, sigma, angle):
    fabric = load_fabric("polyester_lining")
    queries = drawn(fabric, 35, 120, sigma=sigma, max_angle=angle)
    exact = uncalibrated(fabric, queries, fixed(1 << 15, parallax=parallax), 2).mean[:, :4]
    errors = {}
    for error in (1.0, 0.005):
        found = uncalibrated(fabric, queries, TruthOptions(relative_error=error, parallax=parallax), 5)
        errors[error] = np.linalg.norm(found.mean[:, :4] - exact, axis=1) / np.linalg.norm(exact, axis=1)
    # Only refined answers: what was sampled as a whole, or went to the fine table, says nothing of refinement.
    refined = (found.stage == REFINED) & (errors[1.0] != errors[0.005])
    assert refined.sum() > 20
    before, after = (np.sqrt(np.mean(errors[error][refined] ** 2)) for error in (1.0, 0.005))
    assert after < 0.5 * before
