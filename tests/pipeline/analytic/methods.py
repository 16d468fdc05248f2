"""All methods that learn nothing, as functions of a cloth and queries."""

from functools import lru_cache

import numpy as np

from pipeline.analytic import exact_points, prefiltered
from pipeline.analytic.soft_nodes import components, nodes
from pipeline.truth.cloth import cloth_side
from pipeline.truth.options import TruthOptions

soft_table = lru_cache(maxsize=64)(nodes.tabulate)
_maps = lru_cache(maxsize=32)(prefiltered.tabulate)


def soft_nodes(fabric, queries, level=2, rims=True):
    return components.read_queries(soft_table(fabric, level=level, rims=rims), queries).components


def unshadowed(fabric, queries):
    """Return the bounds of the soft nodes' components, (N, 4): the same without shadows of the light."""
    return components.read_queries(soft_table(fabric), queries).bounds


def soft_nodes_behind(fabric, queries, rims=True):
    """Return components and transparency with the light mirrored to the other side, (N, 5)."""
    return components.read_behind(
        soft_table(fabric, behind=True, rims=rims), queries._replace(wi=queries.wi * np.float32([1, 1, -1]))
    )


def points(fabric, queries, count=256, rims=True):
    options = TruthOptions(walls="rim" if rims else "left_out")
    return exact_points.sample_points(cloth_side(fabric, options), queries, count, 3, True)[:, :4]


def averaged_normals(fabric, queries):
    return prefiltered.answer(_maps(fabric), queries)


PLACED = [soft_nodes, unshadowed, soft_nodes_behind, averaged_normals]
"""Methods without random numbers."""

ALL = [soft_nodes, points, averaged_normals]
"""Methods that return the four components with the light in front."""
