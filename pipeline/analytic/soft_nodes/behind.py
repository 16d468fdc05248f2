"""Components and transparency of queries with the light behind the cloth, by the soft nodes.

The transparency depends on no light; it is the share of the visible area that gaps have, and yarns unscattered. The
components of a patch hidden almost wholly fade to 0, as those with the light in front do.
"""

from __future__ import annotations

import math

import numpy as np

from pipeline.analytic.soft_nodes.answer import query_sums
from pipeline.analytic.soft_nodes.nodes import Table
from pipeline.analytic.soft_nodes.shade import AREA, BARE_AREA, DIFFUSE, FADED, LEAST_SEEN, SPECULAR, THROUGH, TINY
from pipeline.compiled.arrays import Float32
from pipeline.truth.query import Queries


def read_behind(table: Table, queries: Queries) -> Float32:
    """Return components and transparency of N queries, float32 (N, 5); cloth is curved only if the table knows it.

    Parameters
    ----------
    table : Table
        A cloth with what light from behind needs.
    queries : Queries
        The viewer in front, the light behind, footprints of any shape.
    """
    sums, gaps = query_sums(table, queries)
    bare = sums[:, :, BARE_AREA].sum(axis=1) + gaps
    area = np.maximum(sums[:, :, AREA].sum(axis=1) + gaps, LEAST_SEEN * bare) + TINY
    faded = (area / (area + FADED * bare))[:, None]
    result = np.empty((len(area), 5), np.float32)
    result[:, :2] = faded * sums[:, :, SPECULAR] / area[:, None]
    result[:, 2:4] = faded * sums[:, :, DIFFUSE] / (math.pi * area[:, None])
    result[:, 4] = np.minimum((sums[:, :, THROUGH].sum(axis=1) + gaps) / area, 1.0)
    return result
