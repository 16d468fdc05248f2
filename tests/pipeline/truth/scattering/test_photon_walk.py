"""The slab against a photon walk that shares no formula with it but the density of flake normals.

The walk knows only this: flakes lie with density D about the fibre; light along w meets them at the rate of their
projected area, integrated here from D; a flake met is drawn in proportion to the area it shows; it mirrors. Photons
that meet one flake and leave are what reflection and transmission claim to be; those that meet none are the rest that
goes straight through.
"""

import math

import numpy as np
import pytest
from scipy import stats

from pipeline.truth.scattering.slab import density, reflection, sigma, transmission, unscattered
from tests.directions import unit

LEVEL = 2.7e-3  # 3 sigma, for all comparisons of one kind together
BINS = 4  # of |cos_o| in each hemisphere
NODES = 4000  # of the cosine between flake and fibre, each side of 0
NODES_COSINE, NODES_AZIMUTH = 48, 360  # of the slab in each bin


# alpha, T, light, tangent: at most in the plane of the slab, else tilted out of it.
CONFIGURATIONS = [
    (1.0, 2.0, unit(0, 0), unit(90, 0)),
    (1.0, 0.3, unit(60, 40), unit(80, 0)),
    (0.3, 2.0, unit(0, 0), unit(90, 90)),
    (0.3, 0.5, unit(50, 30), unit(70, 100)),
    (0.3, 5.0, unit(75, 200), unit(60, 10)),
    (0.1, 2.0, unit(30, 0), unit(90, 90)),
    (0.1, 1.0, unit(65, 120), unit(78, 100)),
    (0.1, 4.0, unit(20, 300), unit(55, 250)),
]


class Fibres:
    """Flakes about a tangent, known by tables of their density alone."""

    def __init__(self, alpha, tangent):
        self.tangent = tangent
        side = np.cross(tangent, [0.6, 0.0, 0.8])
        self.first = side / np.linalg.norm(side)
        self.second = np.cross(tangent, self.first)
        # Distribution of mu = m.t under D; arcsinh-spaced nodes resolve its peak of width alpha.
        mu = np.sinh(np.linspace(-1, 1, 2 * NODES + 1) * math.asinh(1 / alpha)) * alpha
        mu[[0, -1]] = -1, 1
        middle = 0.5 * (mu[1:] + mu[:-1])
        flakes = alpha**3 / (math.pi * (alpha**2 * (1 - middle**2) + middle**2) ** 2)
        mass = flakes * np.diff(mu)
        self.mu, self.cumulative = mu, np.concatenate([[0], np.cumsum(mass)]) / mass.sum()
        # Projected area by the angle to the fibre: D <w.m>, its azimuth about the fibre integrated in closed form.
        self.angles = np.linspace(0, math.pi / 2, 800)
        a = np.outer(np.cos(self.angles), middle)
        b = np.outer(np.sin(self.angles), np.sqrt(1 - middle**2))
        edge = np.arccos(np.clip(-a / np.maximum(b, 1e-300), -1, 1))
        self.areas = (2 * (a * edge + b * np.sin(edge))) @ mass

    def area(self, w):
        across = np.linalg.norm(np.cross(w, self.tangent), axis=1)
        return np.interp(np.arctan2(across, np.abs(w @ self.tangent)), self.angles, self.areas)

    def mirrored(self, w, count, rng):
        """Return unit w (3,) mirrored in flakes drawn in proportion to the area they show it, (count, 3)."""
        normals = np.empty((0, 3))
        while len(normals) < count:
            mu = np.interp(rng.uniform(size=count), self.cumulative, self.mu)
            phi = rng.uniform(0, 2 * math.pi, count)
            circle = np.cos(phi)[:, None] * self.first + np.sin(phi)[:, None] * self.second
            proposed = mu[:, None] * self.tangent + np.sqrt(1 - mu**2)[:, None] * circle
            normals = np.concatenate([normals, proposed[rng.uniform(size=count) < np.abs(proposed @ w)]])
        normals = normals[:count]
        return 2 * (normals @ w)[:, None] * normals - w


def _walk(alpha, thickness, light, tangent, count, seed):
    """Return the share of photons that go straight through, and those that leave after one flake, by bins of cos_o."""
    rng = np.random.default_rng(seed)
    fibres = Fibres(alpha, tangent)
    depth = rng.exponential(size=count) / fibres.area(light[None])[0] * light[2]
    depth = depth[depth < thickness]
    through = 1 - len(depth) / count

    # From the flake on: does the photon leave the slab before the next one?
    out = fibres.mirrored(light, len(depth), rng)
    way = np.where(out[:, 2] > 0, depth, thickness - depth) / np.abs(out[:, 2])
    leaves = rng.exponential(size=len(out)) / fibres.area(out) > way
    counts = np.histogram(out[leaves, 2], bins=np.linspace(-1, 1, 2 * BINS + 1))[0]
    return through, counts / count


def _model(alpha, thickness, light, tangent):
    """Return the same numbers from the slab, by Gauss-Legendre in each bin of cos_o and evenly in azimuth."""
    sigma_i = sigma(*light, *tangent, alpha)
    x, share = np.polynomial.legendre.leggauss(NODES_COSINE)
    edges = np.linspace(-1, 1, 2 * BINS + 1)
    energies = np.zeros(2 * BINS)
    azimuths = 2 * math.pi * (np.arange(NODES_AZIMUTH) + 0.5) / NODES_AZIMUTH
    for k in range(2 * BINS):
        half = 0.5 * (edges[k + 1] - edges[k])
        for z, weight in zip(0.5 * (edges[k] + edges[k + 1]) + half * x, half * share, strict=True):
            r, form = math.sqrt(1 - z * z), reflection if z > 0 else transmission
            for phi in azimuths:
                o = (r * math.cos(phi), r * math.sin(phi), z)
                flakes = density(light[0] + o[0], light[1] + o[1], light[2] + z, *tangent, alpha)
                value = form(flakes, sigma_i, sigma(*o, *tangent, alpha), light[2], abs(z), thickness)
                energies[k] += weight * 2 * math.pi / len(azimuths) * value * abs(z)
    return unscattered(sigma_i, light[2], thickness), energies


def _scores(expected, seen, count):
    """Return how many standard errors of a counted share lie between the two."""
    return (seen - expected) / np.sqrt(expected * (1 - expected) / count)


@pytest.mark.slow
def test_photons_leave_as_the_slab_says():
    """8 slabs, three energies and 8 bins of the outgoing cosine each, within 3 standard errors, Sidak-corrected."""
    count, energies, bins = 4_000_000, [], []
    for k, configuration in enumerate(CONFIGURATIONS):
        through, seen = _walk(*configuration, count, 50 + k)
        straight, expected = _model(*configuration)
        ours = np.array([straight, expected[BINS:].sum(), expected[:BINS].sum()])
        theirs = np.array([through, seen[BINS:].sum(), seen[:BINS].sum()])
        energies.append(_scores(ours, theirs, count))
        bins.append(_scores(expected, seen, count))
    for scores in (np.array(energies), np.array(bins)):
        level = 1 - (1 - LEVEL) ** (1 / scores.size)
        assert np.abs(scores).max() < stats.norm.isf(level / 2), np.round(scores, 1)


@pytest.mark.parametrize("alpha", [0.1, 0.3, 1.0])
def test_projected_area_integrated_from_the_density_is_sigma(alpha):
    fibres = Fibres(alpha, unit(70, 30))
    w = np.array([unit(degrees, 7 * degrees) for degrees in range(0, 180, 5)])
    ours = [sigma(*x, *fibres.tangent, alpha) for x in w]
    assert fibres.area(w) == pytest.approx(np.array(ours), rel=2e-5)
