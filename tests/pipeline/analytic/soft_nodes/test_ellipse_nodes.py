"""Nodes on the lines of a thin ellipse: their weights against the Gaussian's own, their answers against the truth."""

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import erf

from pipeline.analytic.soft_nodes.answer import query_sums
from pipeline.analytic.soft_nodes.ellipse_nodes import MOST, ellipse, most_nodes
from pipeline.analytic.soft_nodes.features import read_queries
from pipeline.analytic.soft_nodes.nodes import tabulate
from pipeline.analytic.soft_nodes.shade import BARE_AREA
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.estimator import estimate
from pipeline.truth.footprint.mixture import along_axes
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from tests.pipeline.analytic.methods import soft_table
from tests.presets import slow
from weaves.fabric import load_fabric

COLOUR = np.array([0.3, 0.3, 0.5, 0.5])


@cache
def table(name):
    return tabulate(load_fabric(name))


@settings(max_examples=200, deadline=None)
@given(st.floats(0.01, 5.0), st.floats(0.002, 0.999), st.floats(0.0, math.pi))
def test_an_ellipse_has_its_own_axes_back(major, ratio, angle):
    found = ellipse(*along_axes(major, major * ratio, angle))
    assert found.major == pytest.approx(major, rel=1e-6)
    assert found.minor == pytest.approx(major * ratio, rel=1e-3, abs=1e-6)
    if ratio < 0.99:
        assert abs(found.cosine * math.sin(angle) - found.sine * math.cos(angle)) < 1e-3


@settings(max_examples=100, deadline=None)
@given(
    st.sampled_from(["denim", "voile"]),
    st.floats(0.0, 4.0),
    st.floats(0.0, 4.0),
    st.floats(0.1, 1.2),
    st.floats(2.0, 12.0),
    st.floats(0.05, 3.1),
)
def test_weights_add_up_to_the_footprint(name, u, v, major, stretch, angle):
    """Seen from straight above the bare area is the share of the lines that yarns and gaps cover: all of it.

    Nothing hides a gap here: at the edge of a yarn its own horizon's ramp would, even from straight above.
    """
    minor = min(major / stretch, 0.2)
    up = np.array([[0.0, 0.0, 1.0]])
    columns = [np.array([x]) for x in (u, v, major)]
    queries = Queries(*columns, up, up, np.array([minor]), np.array([angle]), np.zeros(1))
    sums, gaps = query_sums(table(name), queries)
    whole = erf(2.4 / math.sqrt(2.0))  # cut off along the lines
    # Three lines across have .993 of the mass, and parts shorter than .12 one node: 3 % less and more.
    assert float(sums[0, :, BARE_AREA].sum() + gaps[0]) == pytest.approx(whole, abs=0.045)


def test_a_thin_ellipse_covers_what_its_gaussian_covers():
    """The share of the warp, seen from straight above on a plain weave without gaps: it is on top in every other cell.

    Against midpoints along the ellipse's own axes. Where lines meet borders at an angle to the yarns above .35, they
    average over these: 4 % at most. A line along a border lies on one side of it: as far as half its share, 16 %.
    """
    random, count = np.random.default_rng(3), 80
    u, v, angle = random.random(count) * 2.0, random.random(count) * 2.0, random.random(count) * math.pi
    major, minor = random.uniform(0.3, 0.8, count), random.uniform(0.03, 0.15, count)
    up = np.tile([0.0, 0.0, 1.0], (count, 1))
    fabric = load_fabric("polyester_lining")
    queries = Queries.round(u, v, major, up, up)
    queries = queries._replace(sigma_minor=minor.astype(np.float32), angle=angle.astype(np.float32))
    sums, gaps = query_sums(soft_table(fabric), queries)
    assert not gaps.any()
    found = sums[:, 0, BARE_AREA] / sums[:, :, BARE_AREA].sum(axis=1)
    a, b = np.meshgrid((np.arange(320) + 0.5) / 32 - 5.0, (np.arange(160) + 0.5) / 16 - 5.0)
    weight = np.exp(-0.5 * (a**2 + b**2))
    shares = []
    for x, y, turn, long, short in zip(u, v, angle, major, minor, strict=True):
        cosine, sine = math.cos(turn), math.sin(turn)
        end = np.floor(x + long * a * cosine - short * b * sine).astype(int) % 2
        pick = np.floor(y + long * a * sine + short * b * cosine).astype(int) % 2
        shares.append((weight * fabric.weave.warp_over[pick, end]).sum() / weight.sum())
    assert np.ptp(shares) > 0.5
    oblique = np.minimum(abs(np.sin(angle)), abs(np.cos(angle))) > 0.35
    assert oblique.sum() > 30
    np.testing.assert_allclose(found[oblique], np.array(shares)[oblique], atol=0.04)
    np.testing.assert_allclose(found, shares, atol=0.16)


@pytest.mark.parametrize(
    ("sigma", "stretch", "bound"),
    [((0.1, 0.3), 12.0, 0.09), ((0.25, 0.6), 10.0, 0.05)],
    ids=["minor below .1", "below .25"],
)
@pytest.mark.parametrize("name", ["denim", slow("satin_8"), slow("gauze")])
def test_thin_footprints_are_near_the_truth(name, sigma, stretch, bound):
    """RMSE of a grey cloth's colour over its mean; as round footprints of equal area they were 8 to 16 %, 4 to 6 %."""
    fabric = load_fabric(name)
    options = QueryOptions(sigma=sigma, stretch=stretch, max_angle=80.0)
    queries = draw_queries(options, fabric.weave.repeat, 3, 0, 300)
    queries = queries.take(queries.sigma > 2.0 * queries.sigma_minor)
    truth = estimate(fabric, queries, TruthOptions(relative_error=0.01), 1).mean @ COLOUR
    found = read_queries(tabulate(fabric), queries).components @ COLOUR
    assert math.sqrt(np.mean((found - truth) ** 2)) < bound * truth.mean()


def test_the_nodes_of_an_ellipse_are_bounded():
    """The longest lines that are taken fit into the scratch: cells are cut at all borders."""
    table, worst = tabulate(load_fabric("voile")), 0
    up = np.array([[0.0, 0.0, 1.0]])
    for major in np.geomspace(0.05, 20.0, 40):
        for angle in (0.3, 0.785, 1.2):
            shape = ellipse(*along_axes(major, 0.04, angle))
            if most_nodes(shape) <= MOST:
                worst = max(worst, most_nodes(shape))
                queries = Queries(*np.full((3, 1), major), up, up, np.array([0.04]), np.array([angle]), np.zeros(1))
                sums, _ = query_sums(table, queries)
                assert np.isfinite(sums).all()
    assert 0.7 * MOST < worst <= MOST
