import math

import numpy as np
import pytest

from pipeline.truth.cloth import cloth_side, columns_of
from pipeline.truth.footprint.mixture import FINE_LINE
from pipeline.truth.footprint.place import BOX, GAUSSIAN, Axis, place
from pipeline.truth.geometry.heightfield import GAP, surface_at
from pipeline.truth.geometry.pieces import translations
from pipeline.truth.node_table.build import tabulate
from pipeline.truth.node_table.weights import fill_displaced, interval_masses, weight_room
from pipeline.truth.options import TruthOptions
from tests.directions import unit
from tests.pipeline.truth.cloths import LOPSIDED, equal_queries
from weaves.fabric import load_fabric

RAYS = TruthOptions(walls="left_out")


def _weights(fabric, sigma, minor, angle, degrees):
    """Return the weights of nodes, and what they are to be: areas times the Gaussian over all its images."""
    cloth = cloth_side(fabric, RAYS)
    table = tabulate(cloth.front, cloth.back, False, nodes=16, azimuths=4)
    query = equal_queries(unit(30.0, 100.0), unit(degrees, 25.0), sigma, centre=(0.8, 1.3))
    query = query._replace(sigma_minor=np.float32([minor]), angle=np.float32([angle]))
    columns, weight = columns_of(query), np.zeros(len(table.evenly), np.float32)
    fill_displaced(table, cloth.plane, columns, 0, FINE_LINE, weight_room(table, FINE_LINE), weight)
    shift = columns.wo[0, :2] / columns.wo[0, 2]
    x, y, height = table.places.astype(np.float64)
    x, y = x - (height - cloth.plane) * shift[0] - columns.u[0], y - (height - cloth.plane) * shift[1] - columns.v[0]
    picks, ends = cloth.front.top.shape
    reach = math.ceil((6.0 * max(sigma, minor) + 2.0 * np.abs(shift).max()) / min(ends, picks)) + 1
    images = np.arange(-reach, reach + 1)
    expected = np.zeros(len(x))
    for pick, end in translations(cloth.front):
        dx = x[:, None, None] + end + ends * images[:, None]
        dy = y[:, None, None] + pick + picks * images[None, :]
        along, across = dx * math.cos(angle) + dy * math.sin(angle), dy * math.cos(angle) - dx * math.sin(angle)
        expected += np.exp(-0.5 * ((along / sigma) ** 2 + (across / minor) ** 2)).sum(axis=(1, 2))
    copies = len(translations(cloth.front))
    expected *= table.evenly * (ends * picks / copies) / (2.0 * math.pi * sigma * minor)
    return weight, expected


@pytest.mark.parametrize("fabric", [LOPSIDED, load_fabric("satin_8")], ids=["lopsided", "satin"])
@pytest.mark.parametrize(
    ("sigma", "minor", "angle", "degrees"),
    [(0.3, 0.3, 0.0, 60.0), (0.2, 0.2, 0.0, 0.0), (1.2, 1.2, 0.0, 80.0), (1.5, 0.4, 0.6, 50.0), (3.0, 0.5, -2.0, 70.0)],
)
def test_weights_are_areas_times_the_density_where_nodes_are_seen(fabric, sigma, minor, angle, degrees):
    """Interpolation with three points a deviation: its error is below 2 % of the peak anywhere, and of no sign."""
    weight, expected = _weights(fabric, sigma, minor, angle, degrees)
    assert np.abs(weight - expected).max() < 0.02 * expected.max()
    assert weight.sum() == pytest.approx(expected.sum(), rel=2e-3)


def test_heights_of_nodes_are_those_of_the_surface():
    cloth = cloth_side(LOPSIDED, RAYS)
    table = tabulate(cloth.front, cloth.back, False, nodes=6, azimuths=4)
    for x, y, height in table.places.T.astype(np.float64)[::7]:
        family, _, expected, *_ = surface_at(cloth.front, x, y, int(x), int(y))
        assert height == pytest.approx(0.0 if family == GAP else expected, abs=1e-5)


@pytest.mark.parametrize("shape", [GAUSSIAN, BOX])
@pytest.mark.parametrize("sigma", [0.03, 0.3, 1.0, 1.6, 7.0])
def test_masses_of_a_repeat_sum_to_one_and_match_sampled_places(shape, sigma):
    """Chi-square of 40,000 stratified places against the masses of 24 unequal intervals of a repeat of 3."""
    axis = Axis(shape, 2.8, sigma, 3.0)
    edges = np.sort(np.concatenate([[0.0, 1.0], np.random.default_rng(1).random(7)])).astype(np.float32)
    parts = []
    for cell in range(3):
        masses = np.zeros(8, np.float32)
        interval_masses(axis, edges, float(cell), masses)
        parts.append(masses.astype(np.float64))
    masses = np.concatenate(parts)
    assert masses.sum() == pytest.approx(1.0, abs=2e-6)
    borders = np.concatenate([edges[:-1].astype(np.float64) + cell for cell in range(3)] + [[3.0]])
    places = [place(axis, (k + 0.5) / 40_000) for k in range(40_000)]
    found, _ = np.histogram([x for x, _ in places], borders, weights=[w for _, w in places])
    # Stratified places: every interval is right to a place or two at each of its ends.
    np.testing.assert_allclose(found / 40_000, masses, atol=2e-4)
