"""The BRDF of thin cylinders against angles by trigonometry, and its fit."""

import math

import numpy as np

from pipeline.analytic.microcylinder import FITTED_WIDTHS, Cylinders, answer, cylinders_of, fit, lobes
from pipeline.shards.queries import QueryOptions, draw_queries
from tests.pipeline.truth.cloths import IMAGES, LOPSIDED, agree
from weaves.fabric import load_fabric

QUERIES = draw_queries(QueryOptions(max_angle=85.0), (4, 4), 1, 0, 200)


def density(angle, width):
    return math.exp(-0.5 * (angle / width) ** 2) / (width * math.sqrt(2.0 * math.pi))


def both(i, o):
    a, b, u = math.cos(i), math.cos(o), math.exp(-0.5 * ((i - o) / math.radians(20.0)) ** 2)
    return (1.0 - u) * max(a, 0.0) * max(b, 0.0) + u * max(min(a, b), 0.0)


def angles(w, family, tilt):
    """Return theta, phi and psi of a direction."""
    along, across = w[1 - family], w[family]
    t, n = along * math.cos(tilt) - w[2] * math.sin(tilt), along * math.sin(tilt) + w[2] * math.cos(tilt)
    return math.asin(t), math.atan2(across, n), math.atan2(t, n)


def by_angles(threads, wi, wo):
    """Return the lobes of one query as the formulas are written."""
    result, area = np.zeros((2, 3)), (1.0 - threads.cover.sum()) * wo[2]
    for family in range(2):
        for tilt in threads.tilts[family]:
            share = threads.cover[family] / len(threads.tilts[family])
            (theta_i, phi_i, psi_i), (theta_o, phi_o, psi_o) = (angles(w, family, tilt) for w in (wi, wo))
            area += share * max(math.cos(psi_o), 0.0)
            weight = share * both(phi_i, phi_o) * both(psi_i, psi_o) * math.cos(theta_i)
            weight /= math.cos((theta_i - theta_o) / 2) ** 2
            surface, volume = (density((theta_i + theta_o) / 2, width) for width in threads.widths[family])
            even = weight / (math.cos(theta_i) + math.cos(theta_o))
            result[family] += weight * math.cos((phi_i - phi_o) / 2) * surface, even * volume, even
    return result / area


def test_lobes_are_those_of_the_angles_and_a_fit_finds_its_own_answers():
    for name in ("satin_8", "gauze"):
        own = cylinders_of(load_fabric(name))
        assert 0.0 < own.cover.sum() <= 1.0 + 1e-12 and (name == "gauze") == (own.cover.sum() < 0.999)
        made = Cylinders(*own[:2], FITTED_WIDTHS[[[5, 12], [8, 20]]], np.array([[0.1, 0.2, 0.3], [0.05, 0.4, 0.0]]))
        directions = zip(QUERIES.wi.astype(float), QUERIES.wo.astype(float), strict=True)
        expected = [by_angles(made, *pair) for pair in directions]
        np.testing.assert_allclose(lobes(made, QUERIES), expected, rtol=1e-6, atol=1e-9)
        for one, other in zip(fit(own, QUERIES, answer(made, QUERIES).astype(float)), made, strict=True):
            np.testing.assert_allclose(one, other, atol=1e-4)


def test_a_cloth_drawn_in_another_way_has_the_same_answers():
    """A mirror is no other cloth here, because cylinders have no twist."""
    for image, draw in IMAGES.items():
        own, there = (answer(cylinders_of(cloth), q) for cloth, q in ((LOPSIDED, QUERIES), draw(QUERIES)))
        agree(own, there[:, [1, 0, 3, 2] if image == "exchange" else slice(None)], 1e-5, 1e-6)
