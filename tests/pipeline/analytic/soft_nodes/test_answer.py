"""The sums against the truth, to some per cent."""

import math

import numpy as np
import pytest

from pipeline.analytic.soft_nodes.answer import query_sums
from pipeline.analytic.soft_nodes.components import read_queries
from pipeline.analytic.soft_nodes.nodes import tabulate
from pipeline.analytic.soft_nodes.shade import AREA, DIFFUSE, OPEN_DIFFUSE, OPEN_SPECULAR, SPECULAR
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from tests.pipeline.analytic.methods import soft_table
from tests.pipeline.models.against_truth import colour_error, truth_of
from tests.pipeline.truth.cloths import LOPSIDED, drawn, irregular, woven
from tests.presets import slow
from weaves.fabric import load_fabric

GAUZE = load_fabric("gauze")
SIZES = {"narrow": (0.05, 0.2), "middle": (0.3, 1.0), "wide": (3.0, 8.0)}


@pytest.mark.parametrize(
    ("name", "walls", "bound"),
    [("polyester_lining", "rim", 0.02), slow("cotton_twill", "rim", 0.02), slow("satin_8", "left_out", 0.03)],
)
def test_without_shadows_they_are_the_truth(name, walls, bound):
    """What is left is the footprint's tail of 1 %, eight nodes across a yarn and a highlight's four places; shadows are
    2 to 25 %. Options of the truth refuse such rays, which its kernels know."""
    fabric = load_fabric(name)
    options = TruthOptions(estimator="owen", walls=walls, relative_error=5e-3).model_copy(update={"shadows": False})
    for sigma in SIZES.values():
        queries = drawn(fabric, 3, 48, sigma=sigma, max_angle=60.0)
        sums, gaps = query_sums(tabulate(fabric, rims=walls == "rim"), queries)
        assert not gaps.any()
        found = np.concatenate([sums[:, :, OPEN_SPECULAR], sums[:, :, OPEN_DIFFUSE] / math.pi], axis=1)
        found /= sums[:, :, AREA].sum(axis=1, keepdims=True)
        assert colour_error(found, estimate(fabric, queries, options, 1).mean) < bound, sigma


CASES = {
    "plain": (woven("polyester_lining"), (0.08, 0.025, 0.025)),
    "twill": (woven("cotton_twill"), (0.15, 0.03, 0.025)),
    "satin": (woven("silk_charmeuse"), (0.25, 0.05, 0.03)),
    "plain with gaps": (woven("polyester_lining", width=0.7), (0.08, 0.025, 0.025)),
    "twill with gaps": (woven("cotton_twill", width=0.8), (0.15, 0.04, 0.025)),
    "lopsided": (LOPSIDED, (0.15, 0.04, 0.025)),
}


@pytest.mark.parametrize(
    "case", [slow("plain"), slow("twill"), "satin", slow("plain with gaps"), slow("twill with gaps"), "lopsided"]
)
def test_with_shadows_they_are_some_per_cent_off(case):
    """Colour RMSE over the mean for narrow, middle and wide footprints."""
    fabric, bounds = CASES[case]
    table = tabulate(fabric)
    for sigma, bound in zip(((0.06, 0.24), (0.3, 1.0), (3.0, 8.0)), bounds, strict=True):
        queries = drawn(fabric, 7, 80, sigma=sigma, max_angle=75.0)
        assert colour_error(read_queries(table, queries).components, truth_of(fabric, queries)) < bound


def test_footprints_along_the_axes_and_long_ones_and_low_viewers_are_cut():
    """Stretched up to six times, either way round; the same through an angle of a right one."""
    fabric = load_fabric("cotton_twill")
    queries = drawn(fabric, 9, 60, sigma=(0.3, 2.0), max_angle=70.0)
    stretch = np.geomspace(1.0, 6.0, 60).astype(np.float32)
    queries = queries._replace(sigma=queries.sigma * stretch, sigma_minor=queries.sigma / np.sqrt(stretch))
    turned = queries._replace(angle=np.full(60, math.pi / 2, np.float32))
    table = soft_table(fabric)
    for asked in (queries, turned):
        assert colour_error(read_queries(table, asked).components, truth_of(fabric, asked)) < 0.04
    # A footprint longer than LONGEST and narrow across, or a viewer in the plane, answers as the nearest known one.
    table, up = soft_table(load_fabric("denim")), [0.0, 0.0, 1.0]
    for angle in (0.0, 0.3, math.pi / 2):
        long = Queries.round([0.3] * 2, [0.4] * 2, [1e4, 48.0], [up] * 2, [[0.6, 0.0, 0.8]] * 2)
        sums, _ = query_sums(table, long._replace(sigma_minor=np.float32([0.1, 0.1]), angle=np.float32([angle] * 2)))
        assert np.isfinite(sums).all()
        if angle != 0.3:
            np.testing.assert_allclose(sums[0], sums[1], rtol=1e-4, atol=1e-6)
    low = [[math.cos(x), 0.0, math.sin(x)] for x in (1e-5, 0.01745415)]
    sums, _ = query_sums(table, Queries.round([0.3] * 2, [0.4] * 2, [0.1] * 2, [up] * 2, low))
    np.testing.assert_allclose(sums[0], sums[1], rtol=1e-2, atol=1e-6)


def test_footprints_at_an_angle():
    """Stretched up to four times at all angles; round ones of the same area are half as far off again at least."""
    fabric = load_fabric("cotton_twill")
    queries = drawn(fabric, 9, 96, sigma=(0.3, 0.6), max_angle=70.0, stretch=4.0)
    table, truth = soft_table(fabric), truth_of(fabric, queries)
    size = np.sqrt(queries.sigma * queries.sigma_minor)
    rounded = queries._replace(sigma=size, sigma_minor=size)
    wrong = colour_error(read_queries(table, queries).components, truth)
    assert wrong < 0.03
    assert colour_error(read_queries(table, rounded).components, truth) > 1.5 * wrong


@pytest.mark.parametrize("width", [1.0, slow(0.1)])
def test_extremes_stay_finite_and_not_negative(width):
    fabric = woven("silk_charmeuse", roughness=0.01, bend=80.0, width=width)
    table = tabulate(fabric)
    angles = np.radians([0.0, 60.0, 89.0, 89.9])
    sizes = np.float32([1e-3, 0.249, 0.251, 3.0, 1e4])
    grid = np.meshgrid(angles, angles, sizes, sizes, [0.3, 1e6 + 0.3, -1e6], [0.1, 2.0], indexing="ij")
    i, o, major, minor, centre, turn = (axis.ravel() for axis in grid)
    wi = np.stack([np.sin(i) * np.cos(turn), np.sin(i) * np.sin(turn), np.cos(i)], axis=1).astype(np.float32)
    wo = np.stack([np.sin(o), 0 * o, np.cos(o)], axis=1).astype(np.float32)
    centre, major, minor = (column.astype(np.float32) for column in (centre, major, minor))
    queries = Queries.round(centre, centre, major, wi, wo)._replace(sigma_minor=minor)
    for values in read_queries(table, queries):
        assert np.isfinite(values).all()
    assert (read_queries(table, queries).components >= 0).all()


@pytest.mark.slow
def test_irregular_drafts_of_many_floats():
    """Merged groups: wide footprints within 4 %."""
    fabric = irregular(12, seed=12)
    queries = drawn(fabric, 7, 40, sigma=(2.0, 8.0), max_angle=75.0)
    truth = truth_of(fabric, queries, estimator="r2", max_count=1 << 14)
    assert colour_error(read_queries(tabulate(fabric), queries).components, truth) < 0.04


@pytest.mark.parametrize("sigma", [(0.05, 0.2), (0.5, 1.2), (6.0, 9.0)], ids=["narrow", "middle", "wide"])
@pytest.mark.parametrize("name", ["cotton_twill", slow("gauze")])
def test_sums_of_threads_add_up_to_those_of_the_families(name, sigma):
    fabric = load_fabric(name)
    ends, picks = fabric.weave.repeat
    queries = drawn(fabric, 3, 200, sigma=sigma, stretch=4.0, max_angle=60.0)
    whole, gaps = query_sums(tabulate(fabric), queries)
    parts, own_gaps = query_sums(tabulate(fabric, by_thread=True), queries)
    assert parts.shape[1] == ends + picks
    added = np.stack([parts[:, :ends].sum(axis=1), parts[:, ends:].sum(axis=1)], axis=1)
    # Weights are not normalised: components are shares of the area.
    whole /= np.maximum(whole[:, :, AREA].sum(axis=1) + gaps, 1e-9)[:, None, None]
    added /= np.maximum(added[:, :, AREA].sum(axis=1) + own_gaps, 1e-9)[:, None, None]
    # Horizons are means over the cells of one thread in place of those of all, and regimes end elsewhere.
    assert (np.sqrt(np.mean((added - whole) ** 2, axis=0)) < 0.05 * np.abs(whole.mean(axis=0)) + 1e-4).all()
    np.testing.assert_allclose(added.mean(axis=0), whole.mean(axis=0), rtol=0.02, atol=1e-4)


def test_shadows_take_light_away():
    """No sum exceeds that of what is seen without shadows."""
    fabric = load_fabric("denim")
    for sigma in SIZES.values():
        sums, _ = query_sums(soft_table(fabric), drawn(fabric, 6, 100, sigma=sigma, max_angle=85.0))
        for lit, whole in ((DIFFUSE, OPEN_DIFFUSE), (SPECULAR, OPEN_SPECULAR)):
            assert (sums[:, :, lit] >= 0.0).all() and (sums[:, :, lit] <= 1.001 * sums[:, :, whole] + 1e-7).all()


def test_lights_of_one_place_answer_as_each_alone():
    """Lights on both sides follow each other at one place and share its nodes; a change of any column is seen."""
    table = tabulate(GAUZE, behind=True, curved=True)
    for sigma in (*SIZES.values(), (30.0, 40.0)):
        places = drawn(GAUZE, 5, 12, sigma=sigma, stretch=3.0, max_angle=80.0)
        places = places._replace(curvature=np.tile(np.float32([0.0, 0.05]), 6))
        place = np.repeat(np.arange(12), 10)
        lit = places.take(place)._replace(wi=drawn(GAUZE, 6, 120, max_angle=80.0, behind=0.5).wi)
        for column in ("wi", "wo", "u", "v", "sigma", "sigma_minor", "angle", "curvature"):
            values = getattr(lit, column).copy()
            values[::2] = getattr(lit if column == "wi" else places.take(np.roll(place, 10)), column)[::2]
            asked = lit._replace(**{column: values})
            alone = [query_sums(table, asked.take([row])) for row in range(0, 120, 3)]
            for own, by_one in zip(query_sums(table, asked), zip(*alone, strict=True), strict=True):
                np.testing.assert_array_equal(own[::3], np.concatenate(by_one))
