"""Directions drawn by the C++ form: chi-square against the density, means of weights, the delta lobe, both sides."""

import math
from functools import cache

import numpy as np
import pytest
from scipy import stats

from pipeline.analytic.importance.lobes import STRAIGHT, Lobes
from pipeline.analytic.importance.mixture import density_rows
from pipeline.shader.golden import lobes_of
from pipeline.shader.tables import BEHIND, EVERY, tabulate_sides
from tests.directions import sphere, unit
from tests.pipeline.shader.conftest import read
from tests.pipeline.truth.cloths import equal_queries
from tests.presets import slow
from weaves.fabric import load_fabric

LEVEL = 0.01
ROWS, COLUMNS, NODES = 16, 32, 16  # cells in cosine and azimuth; quadrature nodes along each side of a cell
COUNT = 40_000
# Fabric, deviation, and the viewer's angle to the normal and azimuth: more than 90 is behind.
QUICK = {
    "front": ("gingham", 0.4, 35.0, 20.0),
    "grazing, a point": ("gingham", 0.01, 78.0, 130.0),
    "wide, behind": ("gingham", 9.0, 130.0, 250.0),
}
SLOW = {
    "gauze": ("gauze", 0.5, 60.0, 10.0),
    "behind a gauze": ("gauze", 1.0, 105.0, 200.0),
    "filaments": ("silk_charmeuse", 0.3, 50.0, 300.0),
    "filaments along the normal": ("silk_charmeuse", 0.001, 0.0, 0.0),
}
CONFIGURATIONS = QUICK | SLOW
NAMES = [*QUICK, *map(slow, SLOW)]
# Sidak over the configurations.
LEAST = 1.0 - (1.0 - LEVEL) ** (1.0 / len(CONFIGURATIONS))


def look(name):
    """Return the row of a configuration, light along the viewer."""
    _, deviation, degrees, azimuth = CONFIGURATIONS[name]
    wo = unit(degrees, azimuth)
    return np.array([0.62, 0.57, deviation, deviation, 0.0, *wo, *wo, 0.0], np.float32)


def scattered(cpp, cloth, name, wi, random):
    rows = np.tile(look(name), (len(random), 1))
    rows[:, 5:8] = wi
    return cpp(cloth.buffers, np.column_stack([rows, random]), "scatter")


@cache
def sides_of(fabric):
    return tabulate_sides(load_fabric(fabric), 2, (BEHIND,))


def density(name, wi):
    """Return the density of directions by the Python, (N,), and the probability of light straight through."""
    row = look(name)
    lobes = lobes_of(sides_of(CONFIGURATIONS[name][0]), equal_queries(row[8:11], row[8:11], row[2], 1, row[:2]))
    result = np.empty(len(wi), np.float32)
    repeated = Lobes(*(np.ascontiguousarray(np.repeat(column, len(wi), axis=0)) for column in lobes))
    wo = np.tile(row[8:11], (len(wi), 1))
    density_rows(repeated, np.ascontiguousarray(wi, np.float32), wo, result)
    return result.astype(np.float64), float(lobes.rest[0, STRAIGHT])


@pytest.mark.parametrize("name", NAMES)
def test_samples_follow_the_density_of_the_python(cpp, exported, name):
    """Chi-square over the cells of the sphere and the delta lobe; cells of fewer than 20 expected samples pooled."""
    cloth = read(exported(CONFIGURATIONS[name][0], kinds=(EVERY,)))
    random = np.random.default_rng(17).random((COUNT, 3)).astype(np.float32) * np.float32(1.0 - 1e-7)
    found = scattered(cpp, cloth, name, look(name)[5:8], random)
    wi, pdf, straight = found[:, :3], found[:, 3], found[:, 7] > 0.5
    np.testing.assert_allclose(np.linalg.norm(wi, axis=1), 1.0, atol=2e-6)
    assert (pdf > 0.0).all()
    np.testing.assert_allclose(wi[straight], -np.tile(look(name)[8:11], (int(straight.sum()), 1)))

    expected, probability = density(name, np.concatenate([sphere(ROWS * NODES, COLUMNS * NODES), wi]))
    at_cells, at_samples = expected[:-COUNT], expected[-COUNT:]
    np.testing.assert_allclose(pdf[straight], probability, rtol=1e-5)
    # At the height of a lobe the last digit of a half vector counts.
    np.testing.assert_allclose(pdf[~straight], at_samples[~straight], rtol=2e-3)

    cell = 4.0 * math.pi / (ROWS * COLUMNS * NODES**2)
    shares = at_cells.reshape(ROWS, NODES, COLUMNS, NODES).sum(axis=(1, 3)).ravel() * cell
    assert shares.sum() + probability == pytest.approx(1.0, abs=3e-3)
    rows = np.minimum((wi[~straight, 2] + 1.0) * (ROWS / 2), ROWS - 1).astype(int)
    turn = np.mod(np.arctan2(wi[~straight, 1], wi[~straight, 0]), 2.0 * math.pi)
    columns = np.minimum(turn * COLUMNS / (2.0 * math.pi), COLUMNS - 1).astype(int)
    seen = np.append(np.bincount(rows * COLUMNS + columns, minlength=ROWS * COLUMNS), straight.sum())
    mean = COUNT * np.append(shares, probability) / (shares.sum() + probability)
    few = mean < 20.0
    seen, mean = np.append(seen[~few], seen[few].sum()), np.append(mean[~few], mean[few].sum())
    seen, mean = seen[mean > 0.0], mean[mean > 0.0]
    assert stats.chisquare(seen, mean).pvalue > LEAST


@pytest.mark.parametrize("name", NAMES)
def test_weights_have_the_mean_of_the_bsdf(cpp, exported, name):
    """A z-test for each colour: drawn directions against even ones, at LEAST over three."""
    cloth = read(exported(CONFIGURATIONS[name][0], kinds=(EVERY,)))
    rng = np.random.default_rng(23)
    random = rng.random((COUNT, 3)).astype(np.float32) * np.float32(1.0 - 1e-7)
    z, turn = 2.0 * rng.random(COUNT) - 1.0, 2.0 * math.pi * rng.random(COUNT)
    even = np.column_stack([np.sqrt(1.0 - z * z) * np.cos(turn), np.sqrt(1.0 - z * z) * np.sin(turn), z])
    found = scattered(cpp, cloth, name, even.astype(np.float32), random).astype(np.float64)
    straight = found[:, 7] > 0.5
    through = found[straight, 12] / found[straight, 3]
    np.testing.assert_allclose(found[straight, 4:7], np.repeat(through[:, None], 3, axis=1), rtol=1e-5)
    weights, values = np.where(straight[:, None], 0.0, found[:, 4:7]), 4.0 * math.pi * found[:, 8:11]
    apart = weights.mean(axis=0) - values.mean(axis=0)
    error = np.sqrt((weights.var(axis=0) + values.var(axis=0)) / COUNT)
    assert (values.mean(axis=0) > 0.0).all()
    assert (np.abs(apart) < stats.norm.isf(LEAST / 6.0) * error).all()
