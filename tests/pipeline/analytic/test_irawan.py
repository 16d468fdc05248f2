"""Highlights along yarns against a smeared delta function, and their fit."""

import math

import numpy as np

from pipeline.analytic.irawan import irawan
from pipeline.analytic.microcylinder import microcylinder
from pipeline.shards.queries import QueryOptions, draw_queries
from tests.pipeline.truth.cloths import images_agree
from weaves.fabric import load_fabric

QUERIES = draw_queries(QueryOptions(max_angle=80.0), (4, 4), 1, 0, 60)
SMEARED = 2e-3  # standard deviation in h . t


def by_area(fabric, family, wi, wo):
    """Return I cos_i for one query: the delta function is a narrow normal density over a float's surface.

    The places v are the model's 16; its curve of highlights has jumps at the ends of the float.
    """
    yarn, (_, bend, _, thin) = (fabric.warp, fabric.weft)[family], irawan(fabric).threads
    i, o = (w if family == 0 else np.array([w[1], -w[0], w[2]]) for w in (wi, wo))
    end, psi = bend[family], math.radians(yarn.twist)
    v = ((np.arange(16) + 0.5) / 16 - 0.5)[:, None] * math.pi
    u = ((np.arange(20000) + 0.5) / 10000 - 1.0) * end
    normal = np.stack([np.sin(v) + 0 * u, np.sin(u) * np.cos(v), np.cos(u) * np.cos(v)], axis=-1)
    along = np.cos(u) * math.cos(psi) + np.sin(u) * np.sin(v) * math.sin(psi)
    up = np.cos(u) * np.sin(v) * math.sin(psi) - np.sin(u) * math.cos(psi)
    fibre = np.stack([-np.cos(v) * math.sin(psi) + 0 * u, along, up], axis=-1)
    density = np.exp(-0.5 * (fibre @ (i + o) / SMEARED) ** 2) / (SMEARED * math.sqrt(2.0 * math.pi))
    lit, seen = np.maximum(normal @ i, 0.0), np.maximum(normal @ o, 0.0)
    area = 0.5 * (1.0 / (2.0 * math.sin(end)) + thin[family] * np.cos(v))
    integrand = area * density * lit * seen / np.maximum(lit + seen, 1e-9)
    return integrand.sum() * (math.pi / 16) * (2.0 * end / len(u)) * i[2]


def test_highlights_are_those_of_a_smeared_delta_function_and_a_fit_finds_its_own_answers():
    for name in ("wool_gabardine", "silk_charmeuse"):
        fabric = load_fabric(name)
        own = irawan(fabric)
        np.testing.assert_allclose(own.threads[0], microcylinder(fabric).threads[0], atol=0.02)
        for family in range(2):
            values = own.lobes(own.parameters, QUERIES)[:, family, 0] / own.threads[0][family]
            directions = zip(QUERIES.wi.astype(float), QUERIES.wo.astype(float), strict=True)
            expected = np.array([by_area(fabric, family, *pair) for pair in directions])
            # An end of a float within the smeared band is cut by one and not by the other.
            agree = np.abs(values - expected) < 0.01 * expected.max()
            assert expected.max() > 0.1 and agree.mean() > 0.9, np.stack([values, expected])[:, ~agree]
        betas, scales = np.array([[2.0, 0.5], [4.0, 0.5]]), np.array([[0.1, 0.4, 0.3], [0.3, 0.2, 0.1]])
        made = own._replace(parameters=betas, scales=scales)
        fitted = own.fitted(QUERIES, made.answer(QUERIES).astype(float))
        np.testing.assert_allclose(fitted.parameters, betas)
        np.testing.assert_allclose(fitted.scales, scales, atol=1e-4)
    images_agree(lambda cloth, queries: irawan(cloth).answer(queries), QUERIES, 1e-5, 1e-6)
