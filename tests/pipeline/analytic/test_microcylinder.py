"""The BRDF of thin cylinders against angles by trigonometry, and its fit."""

import math

import numpy as np

from pipeline.analytic.microcylinder import microcylinder
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


def by_angles(threads, widths, wi, wo):
    """Return the lobes of one query as the formulas are written."""
    (cover, tilts), result = threads, np.zeros((2, 3))
    area = (1.0 - cover.sum()) * wo[2]
    for family in range(2):
        for tilt in tilts[family]:
            share = cover[family] / len(tilts[family])
            (theta_i, phi_i, psi_i), (theta_o, phi_o, psi_o) = (angles(w, family, tilt) for w in (wi, wo))
            area += share * max(math.cos(psi_o), 0.0)
            weight = share * both(phi_i, phi_o) * both(psi_i, psi_o) * math.cos(theta_i)
            weight /= math.cos((theta_i - theta_o) / 2) ** 2
            surface, volume = (density((theta_i + theta_o) / 2, width) for width in widths[family])
            even = weight / (math.cos(theta_i) + math.cos(theta_o))
            result[family] += weight * math.cos((phi_i - phi_o) / 2) * surface, even * volume, even
    return result / area


def test_lobes_are_those_of_the_angles_and_a_fit_finds_its_own_answers():
    for name in ("satin_8", "gauze"):
        own = microcylinder(load_fabric(name))
        cover = own.threads[0].sum()
        assert 0.0 < cover <= 1.0 + 1e-12 and (name == "gauze") == (cover < 0.999)
        widths = np.array(own.tried)[[[5, 12], [8, 20]]]
        made = own._replace(parameters=widths, scales=np.array([[0.1, 0.2, 0.3], [0.05, 0.4, 0.0]]))
        directions = zip(QUERIES.wi.astype(float), QUERIES.wo.astype(float), strict=True)
        expected = [by_angles(own.threads, widths, *pair) for pair in directions]
        np.testing.assert_allclose(own.lobes(widths, QUERIES), expected, rtol=1e-6, atol=1e-9)
        fitted = own.fitted(QUERIES, made.answer(QUERIES).astype(float))
        np.testing.assert_allclose(fitted.parameters, widths)
        np.testing.assert_allclose(fitted.scales, made.scales, atol=1e-4)
    # A mirror is no other cloth here, because cylinders have no twist.
    for image, draw in IMAGES.items():
        here, there = (microcylinder(cloth).answer(q) for cloth, q in ((LOPSIDED, QUERIES), draw(QUERIES)))
        agree(here, there[:, [1, 0, 3, 2] if image == "exchange" else slice(None)], 1e-5, 1e-6)
