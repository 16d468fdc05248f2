"""Light of the second and all further bounces between yarns, in the colours of a cloth.

Components are light that a yarn has from the sun alone. What yarns have from each other depends on the colours of
all of them. So it is added where components become colours, from a table of the cloth that all methods share
(`pipeline.analytic.bounces`). The table knows no place and no footprint.
"""

from __future__ import annotations

import numpy as np

from pipeline.analytic.bounces.table import bounce_table, bounced
from pipeline.compiled.arrays import Float32, Float64
from pipeline.per_fabric import PerFabric
from pipeline.scenes.options import Bounces
from pipeline.truth.query import Queries
from weaves.errors import BadInput
from weaves.fabric import Fabric

_TABLES = PerFabric(bounce_table)


def check_bounces(bounces: Bounces, where: str) -> None:
    """Raise BadInput for another number of bounces."""
    if bounces not in (1, "all"):
        raise BadInput(where, "bounces", bounces, 'must be 1 or "all"')


def later_bounces(fabric: Fabric, queries: Queries, colours: Float32 | Float64) -> Float64:
    """Return the light of all bounces after the first, linear RGB by the family that is seen, (N, 2, 3), in 1/sr.

    It belongs to the diffuse components. The yarns that are seen have their own diffuse colours, those of `colours`,
    (N, 4, 3); yarns further back have the mean ones of the cloth.
    """
    return light_between(fabric, queries) * colours[:, 2:]


def light_between(fabric: Fabric, queries: Queries) -> Float64:
    """Return the same where the yarns that are seen are white, (N, 2, 3).

    0 where light and viewer are on different sides: of transmitted light only the first bounce is known. Tables are
    made at their first use, which takes seconds.
    """
    average, result = fabric.average(), np.zeros((len(queries.u), 2, 3))
    diffuse = np.array([average.warp.diffuse_rgb, average.weft.diffuse_rgb])
    for behind in (False, True):
        rows = np.flatnonzero(((queries.wo[:, 2] < 0.0) == behind) & (queries.wi[:, 2] * queries.wo[:, 2] > 0.0))
        if rows.size:
            seen = queries.take(rows)
            seen, side = (seen.turned(), fabric.back()) if behind else (seen, fabric)
            result[rows] = bounced(_TABLES.of(side), seen.wi, seen.wo, diffuse)
    return result
