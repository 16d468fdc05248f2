import math

import numpy as np
import pytest
from scipy.stats import norm

from pipeline.analytic.footprint_colours import footprint_colours
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from pipeline.truth.scattering.thread_colours import component_colours
from tests.pipeline.truth.cloths import LOPSIDED, OVER, coloured, drawn, exchanged_axes, redrawn
from tests.presets import slow
from weaves.fabric import load_fabric
from weaves.surface import surface_at

STRIPES = {"ends": [["red", 3], ["blue", 2]], "picks": [["blue", 1], ["red", 4]]}


def queries(rows, rng, minor=None, behind=False):
    wi, wo = np.tile([0.6, 0.0, -0.8 if behind else 0.8], (rows, 1)), np.tile([0.0, 0.0, 1.0], (rows, 1))
    found = Queries.round(rng.random(rows) * 30, rng.random(rows) * 30, np.exp(rng.uniform(-2, 0, rows)), wi, wo)
    return found if minor is None else found._replace(sigma_minor=found.sigma * np.float32(minor), angle=found.u)


@pytest.mark.parametrize("minor", [slow(None), 0.4])
def test_from_behind_colours_are_means_over_what_is_seen_from_above(minor):
    fabric = coloured("gauze", **STRIPES)
    asked = queries(3, np.random.default_rng(1), minor, behind=True)
    found = footprint_colours(fabric, asked)
    count = 1200 if minor is None else 300
    step = (np.arange(count) + 0.5) / count * 9.0 - 4.5
    for row in range(3):
        size, turn = float(asked.sigma[row]), float(asked.angle[row])
        x, y = np.broadcast_arrays(asked.u[row] + size * step[None, :], asked.v[row] + size * step[:, None])
        along = (x - asked.u[row]) * math.cos(turn) + (y - asked.v[row]) * math.sin(turn)
        across = (y - asked.v[row]) * math.cos(turn) - (x - asked.u[row]) * math.sin(turn)
        mass = np.exp(-0.5 * (along / size) ** 2 - 0.5 * (across / float(asked.sigma_minor[row])) ** 2)
        cell = surface_at(fabric, np.floor(x) + 0.5, np.floor(y) + 0.5)
        for family, place in enumerate((x, y)):
            colours = fabric.thread_colours()[family].specular
            yarn, other = (fabric.warp, fabric.weft) if family == 0 else (fabric.weft, fabric.warp)
            weight = mass * np.where(cell.yarn == family, 1.0, 1.0 - other.width) * yarn.width
            expected = (weight[..., None] * colours[np.floor(place).astype(int) % 5]).sum(axis=(0, 1)) / weight.sum()
            # A coarse line has components 2 % off the ellipse's waves.
            assert found[row, family] == pytest.approx(expected, abs=0.002 if minor is None else 0.03)


@pytest.mark.parametrize("name", ["gauze", slow("crepe")])
@pytest.mark.parametrize(
    ("sigma", "stretch", "bound"), [((0.1, 0.6), 1.0, 0.02), ((0.8, 2.0), 1.0, 0.03), ((0.2, 0.5), 3.0, 0.04)]
)
def test_each_component_has_its_own_shares_of_the_threads(name, sigma, stretch, bound):
    """RMSE of the colour over its mean square, against the exact shares, which err by less than a quarter of the bound.
    Components are those of the truth in both."""
    fabric = coloured(name, **STRIPES)
    asked = drawn(fabric, 3, 24, sigma=sigma, stretch=stretch, max_angle=75.0)
    components = estimate(fabric, asked, TruthOptions(estimator="owen", max_count=1024), 1).mean
    exact = component_colours(fabric, asked, TruthOptions(relative_error=0.006, max_count=1 << 13), 2)
    colours = exact.mean, footprint_colours(fabric, asked)
    truth, found = (np.einsum("nc,ncx->nx", components, own) for own in colours)
    assert math.sqrt(np.mean(exact.standard_error**2) / np.mean(truth**2)) < 0.25 * bound
    assert math.sqrt(np.mean((found - truth) ** 2) / np.mean(truth**2)) < bound


def test_threads_are_those_that_a_grazing_viewer_sees():
    """A thread of height h is seen h tan(theta) away, up to three yarns here; colours err no more than from above."""
    fabric, random = load_fabric("tartan"), np.random.default_rng(5)
    asked = drawn(fabric, 3, 40, sigma=(0.1, 0.5), max_angle=60.0)
    turn, theta = random.uniform(0.0, 2.0 * math.pi, 40), random.uniform(math.radians(70.0), math.radians(82.0), 40)
    wo = np.stack([np.sin(theta) * np.cos(turn), np.sin(theta) * np.sin(turn), np.cos(theta)], axis=1)
    asked = asked._replace(wo=wo.astype(np.float32))
    components = estimate(fabric, asked, TruthOptions(estimator="owen", max_count=1024), 1).mean
    exact = component_colours(fabric, asked, TruthOptions(relative_error=0.02, max_count=1 << 11), 2)
    truth, found = (np.einsum("nc,ncx->nx", components, own) for own in (exact.mean, footprint_colours(fabric, asked)))
    assert math.sqrt(np.mean((found - truth) ** 2) / np.mean(truth**2)) < 0.03


@pytest.mark.parametrize("sigma", [0.03, 0.4, 1.5, 3.0])
def test_stripes_have_the_mass_of_a_gaussian(sigma):
    """Ends of two colours, three and two, in a footprint long along them: each end is seen half, whichever it is."""
    fabric = coloured("polyester_lining", ends=[["red", 3], ["blue", 2]])
    u, up = np.linspace(0.0, 10.0, 21), np.tile([0.0, 0.0, 1.0], (21, 1))
    asked = Queries.round(u, np.zeros(21), np.full(21, sigma), -up, up)
    found = footprint_colours(fabric, asked._replace(sigma_minor=np.full(21, 64.0, np.float32)))[:, 0]
    first = 5.0 * np.arange(-8, 9)[:, None]
    red = (norm.cdf(first + 3.0, u, sigma) - norm.cdf(first, u, sigma)).sum(axis=0)[:, None]
    colours = fabric.thread_colours()[0].specular
    np.testing.assert_allclose(found, red * colours[0] + (1.0 - red) * colours[3], atol=1e-4)
    # The picks have one colour.
    picks = footprint_colours(fabric, asked)[:, 1]
    np.testing.assert_allclose(picks, np.tile(fabric.weft.specular_rgb, (21, 1)), atol=1e-6)


@pytest.mark.parametrize("behind", [slow(False), True])
def test_a_cloth_turned_has_its_threads_in_reverse_and_ends_and_picks_change_places(behind):
    """The plain weave is its own half turn; ends and picks of two colours are not."""
    fabric = coloured("voile", **STRIPES)
    other = coloured("voile", ends=[["blue", 2], ["red", 3]], picks=[["red", 4], ["blue", 1]])
    asked = queries(60, np.random.default_rng(2), 0.4, behind)
    extent, signs = np.float32(fabric.repeat), np.float32([-1.0, -1.0, 1.0])
    turned = asked._replace(u=extent[0] - asked.u, v=extent[1] - asked.v, wi=asked.wi * signs, wo=asked.wo * signs)
    own, there = footprint_colours(fabric, asked), footprint_colours(other, turned)
    assert np.ptp(own, axis=0)[[0, 1, 2 - behind, 3 - behind]].max() > 0.1
    assert np.abs(own - there).max() < 0.05 and np.abs(own - there).mean() < 1e-3
    # A mirror in the diagonal of a cloth without symmetries: the transposed draft, yarns and orders exchanged.
    own, other = LOPSIDED, redrawn(~OVER.T, swap=True, mirrored=True)
    asked = queries(60, np.random.default_rng(2), 0.4, behind)
    # Seen from straight above, nodes lie on lines along x in both.
    asked = asked._replace(wo=np.tile(np.float32([0.36, 0.48, 0.8]), (60, 1)))
    one = footprint_colours(coloured(own, **STRIPES), asked)
    there = footprint_colours(coloured(other, ends=STRIPES["picks"], picks=STRIPES["ends"]), exchanged_axes(asked))
    assert np.ptp(one, axis=0)[2 - 2 * behind :].max() > 0.1
    assert np.abs(one - there[:, [1, 0, 3, 2]]).max() < 0.05 and np.abs(one - there[:, [1, 0, 3, 2]]).mean() < 1e-3


def test_neither_a_move_nor_the_footprint_changes_the_mean_and_light_from_behind_is_transmitted():
    """15 ends and 15 picks of a weave of 3: a move by the weave's repeat alone meets other threads."""
    fabric = coloured(LOPSIDED, **STRIPES)
    asked = queries(40, np.random.default_rng(4))
    asked = asked._replace(u=np.round(asked.u * 64) / 64, v=np.round(asked.v * 64) / 64)
    assert fabric.repeat == (15, 15)
    own, far, near = (
        footprint_colours(fabric, asked._replace(u=asked.u + np.float32(move), v=asked.v - np.float32(move)))
        for move in (0, 15 * 128, 3)
    )
    np.testing.assert_allclose(far, own, atol=1e-4)
    assert np.abs(near - own).max() > 0.1
    # Masses are integrals: over a lattice of centres, every size of footprint has the mean of the threads.
    fabric = coloured("twill_4_4", ends=[["red", 3], ["blue", 1]], picks=[["red", 1], ["blue", 5]])
    u, v = np.mgrid[0 : fabric.repeat[0] : 0.5, 0 : fabric.repeat[1] : 0.5].reshape(2, -1)
    wi, wo = np.tile([0.6, 0.0, 0.8], (u.size, 1)), np.tile([0.0, 0.0, 1.0], (u.size, 1))
    wide = footprint_colours(fabric, Queries.round([0.0], [0.0], [1e3], wi[:1], wo[:1]))
    for size in (2.0, 7.0, 40.0):
        found = footprint_colours(fabric, Queries.round(u, v, np.full(u.size, size), wi, wo))
        assert found.mean(axis=0) == pytest.approx(wide[0], abs=0.01)
    assert np.ptp(found, axis=0) == pytest.approx(np.zeros((4, 3)), abs=1e-4)
    palette = {"red": {"diffuse": [0.1, 0.1, 0.2], "diffuse_transmission": [0.5, 0.3, 0.1]}}
    fabric = coloured("voile", palette=palette, ends=[["red", 1]])
    found = footprint_colours(fabric, queries(2, np.random.default_rng(1), behind=True))
    assert found[:, 2] == pytest.approx(np.tile([0.5, 0.3, 0.1], (2, 1)))
    assert found[:, 0] == pytest.approx(np.tile(fabric.warp.specular_rgb, (2, 1)))
    assert found[:, 3] == pytest.approx(np.tile(fabric.weft.diffuse_transmission_rgb, (2, 1)))
