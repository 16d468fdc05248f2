"""The sampler's density is exact: chi-square over the sphere, integrals, and its limit at a point."""

import itertools
import math

import numpy as np
import pytest
from scipy import stats

from pipeline.models.sampler import Sampler
from pipeline.models.soft_nodes.model import SoftNodes
from pipeline.truth.query import Queries
from weaves.fabric import load_fabric

LEVEL = 0.01
ROWS, COLUMNS, NODES = 16, 32, 16  # cells in cosine and azimuth; quadrature nodes along each side of a cell
COUNT = 100_000
FABRICS = [load_fabric(name) for name in ("polyester_lining", "silk_charmeuse", "voile")]
CONFIGURATIONS = list(itertools.product(FABRICS, (0.02, 1.5), ((30.0, 20.0), (75.0, 130.0))))


def unit(degrees, azimuth):
    theta, phi = math.radians(degrees), math.radians(azimuth)
    return math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)


def asked(wi, wo, sigma, count):
    u, v, s = (np.full(count, value, np.float32) for value in (0.62, 0.57, sigma))
    wo = np.tile(np.array(wo, np.float32), (count, 1))
    return Queries.round(u, v, s, wo if wi is None else wi.astype(np.float32), wo)


def expected_shares(sampler, fabric, sigma, wo):
    """Integrate the density over each cell by midpoints."""
    z = -1.0 + 2.0 * (np.arange(ROWS * NODES) + 0.5) / (ROWS * NODES)
    turn = 2.0 * math.pi * (np.arange(COLUMNS * NODES) + 0.5) / (COLUMNS * NODES)
    sine = np.sqrt(1.0 - z * z)[:, None]
    wi = np.stack(np.broadcast_arrays(sine * np.cos(turn), sine * np.sin(turn), z[:, None]), axis=-1).reshape(-1, 3)
    pdf = sampler.pdf(fabric, asked(wi, wo, sigma, len(wi)))
    cell = 4.0 * math.pi / (ROWS * COLUMNS * NODES**2)
    return pdf.reshape(ROWS, NODES, COLUMNS, NODES).sum(axis=(1, 3)) * cell


@pytest.mark.parametrize("points", [1, 8])
def test_samples_follow_their_density(points):
    """Chi-square in twelve configurations, cells of fewer than 20 expected samples pooled; Sidak over them at LEVEL."""
    sampler, values = Sampler(points), []
    for number, (fabric, sigma, angles) in enumerate(CONFIGURATIONS):
        wo = unit(*angles)
        share = expected_shares(sampler, fabric, sigma, wo)
        assert share.sum() == pytest.approx(1.0, abs=2e-3)
        random = np.random.default_rng(number).random((COUNT, 3))
        wi, pdf = sampler.sample(fabric, asked(None, wo, sigma, COUNT), random)
        np.testing.assert_allclose(np.linalg.norm(wi, axis=1), 1.0, atol=1e-6)
        assert (pdf > 0).all()
        row = np.minimum(((wi[:, 2].astype(float) + 1) / 2 * ROWS).astype(int), ROWS - 1)
        column = (np.mod(np.arctan2(wi[:, 1], wi[:, 0]) / (2 * math.pi), 1) * COLUMNS).astype(int) % COLUMNS
        seen = np.bincount(row * COLUMNS + column, minlength=ROWS * COLUMNS)
        expected = (share / share.sum()).ravel() * COUNT
        large = expected >= 20
        observed, wanted = (np.append(v[large], v[~large].sum()) for v in (seen, expected))
        values.append(
            stats.chisquare(observed, wanted).pvalue
            if wanted[-1] > 0
            else stats.chisquare(observed[:-1], wanted[:-1]).pvalue
        )
    assert min(values) > 1 - (1 - LEVEL) ** (1 / len(values)), values


def test_the_density_of_a_sample_is_that_of_asking_for_it():
    fabric, wo = FABRICS[0], unit(40.0, 10.0)
    wi, pdf = Sampler().sample(fabric, asked(None, wo, 0.4, 500), np.random.default_rng(1).random((500, 3)))
    np.testing.assert_allclose(Sampler().pdf(fabric, asked(wi, wo, 0.4, 500)), pdf, rtol=1e-4)


def test_patches_that_nobody_sees_still_have_samples():
    fabric, wo = FABRICS[2], unit(89.8, 3.0)
    wi, pdf = Sampler(4).sample(fabric, asked(None, wo, 0.01, 64), np.random.default_rng(1).random((64, 3)))
    assert np.isfinite(wi).all() and (pdf > 0).all()


def test_value_and_density_come_together():
    fabric, wo = FABRICS[0], unit(40.0, 10.0)
    method = SoftNodes()
    wi = np.tile(unit(20.0, 200.0), (5, 1))
    queries = asked(wi, wo, 0.5, 5)
    values, pdf = Sampler().eval_pdf(method, fabric, queries)
    np.testing.assert_array_equal(values, method.predict(fabric, queries))
    np.testing.assert_array_equal(pdf, Sampler().pdf(fabric, queries))
