import math

import mpmath
import numpy as np
import pytest
from scipy import stats

from pipeline.analytic.importance.mixture import sample_flake_scatter
from pipeline.compiled.decorators import allocating_kernel, kernel
from pipeline.truth.footprint.sequences import independent_pair
from pipeline.truth.scattering.slab import density, sigma
from tests.directions import unit
from tests.presets import slow

LEVEL = 1e-3  # chance that a right sampler fails the chi-square test anywhere
ROWS, COLUMNS, NODES = 16, 32, 48  # cells in polar angle and azimuth, and quadrature nodes along each side of a cell


# Given direction and tangent: both tilted; grazing; nearly along the fibre; from behind, across the fibre.
PAIRS = {
    "tilted": (unit(35, 20), unit(75, 65)),
    "grazing": (unit(84, 200), unit(97, 40)),
    "along": (unit(50, 110), unit(51, 111)),
    "behind": (unit(140, 300), unit(90, 30)),
}
CONFIGURATIONS = [(alpha, pair) for alpha in (0.1, 0.3, 1.0) for pair in PAIRS]


@kernel
def flake_scatter_pdf(wx, wy, wz, sx, sy, sz, tx, ty, tz, alpha):
    """Return the density D(h) / (4 sigma(w)) of unit s, in 1/sr; 0 at s = -w, where no half vector exists."""
    return density(wx + sx, wy + sy, wz + sz, tx, ty, tz, alpha) / (4.0 * sigma(wx, wy, wz, tx, ty, tz, alpha))


@allocating_kernel
def _directions(w, t, alpha, key, count):
    directions = np.empty((count, 3))
    for k in range(count):
        first, second = independent_pair(key, k)
        directions[k] = sample_flake_scatter(w[0], w[1], w[2], t[0], t[1], t[2], alpha, first, second)
    return directions


@allocating_kernel
def _cell_integrals(w, t, alpha, rows, columns, nodes):
    """Return the integral of the pdf over cells in polar angle and azimuth, by midpoints. Nodes equal in cosine would
    lie 4 degrees apart at the poles, and lose 6e-4 of a ridge that crosses them."""
    cells = np.zeros((rows, columns))
    step = math.pi / (rows * nodes)
    for row in range(rows * nodes):
        z, r = math.cos((row + 0.5) * step), math.sin((row + 0.5) * step)
        share = 4.0 * math.pi * r * math.sin(0.5 * step) / (columns * nodes)
        for column in range(columns * nodes):
            phi = 2.0 * math.pi * (column + 0.5) / (columns * nodes)
            x, y = r * math.cos(phi), r * math.sin(phi)
            pdf = flake_scatter_pdf(w[0], w[1], w[2], x, y, z, t[0], t[1], t[2], alpha)
            cells[row // nodes, column // nodes] += share * pdf
    return cells


def _counts(directions):
    """Return how many directions fall into each cell of `_cell_integrals`."""
    azimuths = np.arctan2(directions[:, 1], directions[:, 0]) % (2 * math.pi)
    ranges = ((0, math.pi), (0, 2 * math.pi))
    return np.histogram2d(np.arccos(np.clip(directions[:, 2], -1, 1)), azimuths, bins=(ROWS, COLUMNS), range=ranges)[0]


def _chi_square(counts, expected):
    """Return the p-value, with all cells that expect fewer than 5 pooled into one."""
    counts, expected = counts.ravel(), expected.ravel()
    pooled = expected < 5
    if pooled.any():
        counts = np.append(counts[~pooled], counts[pooled].sum())
        expected = np.append(expected[~pooled], expected[pooled].sum())
    return stats.chi2.sf(((counts - expected) ** 2 / expected).sum(), len(counts) - 1)


@pytest.mark.parametrize("count", [400_000, slow(10_000_000)])
@pytest.mark.parametrize("index", range(len(CONFIGURATIONS)))
def test_directions_pass_a_chi_square_test(index, count):
    """P-values above the Sidak share of LEVEL over all configurations; NODES^2 midpoints a cell. The pdf jumps at the
    direction opposite to the given one: doubling the nodes moves no cell by more than a small part of its statistical
    error."""
    alpha, pair = CONFIGURATIONS[index]
    w, t = (np.array(x) for x in PAIRS[pair])
    expected = count * _cell_integrals(w, t, alpha, ROWS, COLUMNS, NODES)
    value = _chi_square(_counts(_directions(w, t, alpha, np.uint64(100 + index), count)), expected)
    assert value > 1.0 - (1.0 - LEVEL) ** (1.0 / len(CONFIGURATIONS)), f"alpha {alpha}, {pair}"


def test_the_first_number_0_mirrors_in_the_axis():
    # alpha = 1: n = m, so first = 0 returns the direction itself, and first = 1/2 turns it by 90 degrees.
    w, t = PAIRS["tilted"]
    assert sample_flake_scatter(*w, *t, 1.0, 0.0, 0.3) == pytest.approx(w, abs=1e-15)
    assert np.dot(sample_flake_scatter(*w, *t, 1.0, 0.5, 0.3), w) == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("alpha", [0.01, 0.1, 1.0])
def test_samples_keep_their_digits_near_the_fibre_axis(alpha):
    """A given direction along the fibre is where matrix forms lose four digits at alpha = .01. n.d = sqrt(1 - first),
    where n and d are rebuilt from the returned direction with S^(1/2) and its inverse in 50 digits. Tolerance: the
    direction is rounded to 1e-16; S^(-1/2) magnifies that by 1/alpha, and the half vector by 1/|w + s|."""
    mpmath.mp.dps = 50
    rng = np.random.default_rng(7)
    for tilt in (0.0, 1e-9, 1e-4, 0.01, 0.3):
        for _ in range(12):
            t = np.array(unit(rng.uniform(20, 160), rng.uniform(0, 360)))
            across = np.cross(t, rng.normal(size=3))
            w = math.cos(tilt) * t + math.sin(tilt) * across / np.linalg.norm(across)
            w = t if tilt == 0.0 else w / np.linalg.norm(w)
            first, second = rng.uniform(size=2)
            s = np.array(sample_flake_scatter(*w, *t, alpha, first, second))
            assert abs(np.linalg.norm(s) - 1) < 4e-16
            assert np.isfinite(flake_scatter_pdf(*w, *s, *t, alpha))
            exact = _cosine_to_axis(w, s, t, alpha)
            assert abs(exact - mpmath.sqrt(1 - mpmath.mpf(first))) < 2e-15 / alpha / np.linalg.norm(w + s)


def _cosine_to_axis(w, s, t, alpha):
    """Return n.d in 50 digits: n = S^(-1/2) h and d = S^(1/2) w, both normalised."""
    w, s, t = (mpmath.matrix([mpmath.mpf(float(x)) for x in v]) for v in (w, s, t))
    projector = t * t.T / (t.T * t)[0]
    d = (mpmath.eye(3) - (1 - mpmath.mpf(alpha)) * projector) * w
    n = (mpmath.eye(3) - (1 - 1 / mpmath.mpf(alpha)) * projector) * (w + s)
    return (n.T * d)[0] / mpmath.sqrt((n.T * n)[0] * (d.T * d)[0])
