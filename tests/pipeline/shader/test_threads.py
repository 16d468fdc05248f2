"""What footprints see of single threads, against the sums of the whole cloth and the colours of methods in Python."""

import numpy as np

from pipeline.analytic.footprint_colours import footprint_colours
from pipeline.analytic.soft_nodes.answer import query_sums
from pipeline.analytic.soft_nodes.nodes import tabulate
from pipeline.scenes.shade import coloured
from pipeline.shader.golden import read_sides, side_colours
from pipeline.shader.tables import tabulate_sides
from pipeline.shader.threads import by_copy
from pipeline.truth.query import Queries
from tests.directions import unit
from weaves.fabric import load_fabric


def looks(sizes):
    """Return footprints of these deviations, forty of each anywhere in 16 x 16 yarns."""
    rng, sigma = np.random.default_rng(8), np.repeat(sizes, 40)
    wi, wo = (np.array([unit(*row) for row in rng.uniform((0, 0), (60, 360), (len(sigma), 2))]) for _ in range(2))
    u, v = rng.uniform(0.0, 16.0, (2, len(sigma)))
    return Queries.round(*(np.asarray(column, np.float32) for column in (u, v, sigma, wi, wo)))


def test_sums_of_all_threads_near_are_those_of_the_cloth_in_the_colours_of_methods():
    table, queries = tabulate(load_fabric("houndstooth")), looks((0.05, 0.4, 0.8))
    (whole, gaps), (parts, own) = query_sums(table, queries), query_sums(by_copy(table), queries)
    of_families = np.stack([part.sum(axis=1) for part in np.split(parts, 2, axis=1)], axis=1)
    np.testing.assert_allclose(of_families, whole, atol=2e-5 * whole.max())
    np.testing.assert_allclose(own, gaps, atol=1e-6)
    # These weigh every thread of the repeat by its light, and its copies by what is seen of them: 1 % apart.
    fabric, queries = load_fabric("gingham"), looks((0.05, 0.4, 2.0, 8.0))
    sides = tabulate_sides(fabric, 2, ())
    components = read_sides(sides, queries)[:, :4]
    own, others = side_colours(sides)(queries), footprint_colours(fabric, queries)
    seen, wanted = coloured(components, own), coloured(components, others)
    means = coloured(components, np.broadcast_to(sides.colours[:4], (len(queries.u), 4, 3)))
    apart, of_means = (np.sqrt(np.square(a - wanted).mean() / np.square(wanted).mean()) for a in (seen, means))
    assert apart < 0.01 < 0.1 < of_means
