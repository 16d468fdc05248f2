"""Light of the second and all further bounces between yarns, in the colours of a cloth.

Components are light that a yarn has from the sun alone. What yarns have from each other depends on the colours of
all of them. So it is added where components become colours, from a table of the cloth that all methods share
(`pipeline.analytic.bounces`). The table knows no place and no footprint. Light from behind, and light that comes
through yarns, has a larger table: that of cloth with gaps or with a colour k_dt.
"""

from functools import partial

import numpy as np

from pipeline.analytic.bounces.table import WALKS, BounceTable, bounce_table, bounced
from pipeline.compiled.arrays import Float32, Float64
from pipeline.per_fabric import PerFabric
from pipeline.scenes.options import Bounces
from pipeline.truth.query import Queries
from weaves.errors import BadInput
from weaves.fabric import Fabric

Tables = tuple[PerFabric[BounceTable], PerFabric[BounceTable]]
"""Tables of light from the viewer's side, and of light from either side."""


def tables_of(walks: int = WALKS) -> Tables:
    """Return tables that are made of so many walks at their first use."""
    return PerFabric(partial(bounce_table, walks=walks)), PerFabric(partial(bounce_table, walks=walks, through=True))


_TABLES, _TABLES_THROUGH = tables_of()


def check_bounces(bounces: Bounces, where: str) -> None:
    """Raise BadInput for another number of bounces."""
    if bounces not in (1, "all"):
        raise BadInput(where, "bounces", bounces, 'must be 1 or "all"')


def later_bounces(fabric: Fabric, queries: Queries, colours: Float32 | Float64) -> Float64:
    """Return the light of all bounces after the first, linear RGB by the family that is seen, (N, 2, 3), in 1/sr.

    It belongs to the diffuse components. The yarns that are seen have their own diffuse colours, those of `colours`,
    (N, 4, 3), for the way in which they send on the first bounce; else, and further back, colours are the mean ones of
    the cloth.
    """
    return seen_light(light_between(fabric, queries), colours)


def seen_light(between: Float32 | Float64, colours: Float32 | Float64) -> Float64:
    """Return what is seen of the light between yarns, (N, 2, 3), from `light_between` and `later_bounces`' colours."""
    return np.asarray(between[:, :2] * colours[:, 2:] + between[:, 2:])


def light_between(fabric: Fabric, queries: Queries, tables: Tables | None = None) -> Float64:
    """Return light of all bounces after the first by the family that is seen, twice, (N, 4, 3).

    First what lacks its diffuse colour: k_d, or k_dt if light and viewer are on different sides. Then what has left it
    in the other way, in its mean colour. Tables are made at their first use, which takes seconds; all callers that name
    none have the same ones.
    """
    plain, of_both_sides = tables or (_TABLES, _TABLES_THROUGH)
    average, result = fabric.average(), np.zeros((len(queries.u), 4, 3))
    yarns = average.warp, average.weft
    diffuse = np.array([yarn.diffuse_rgb for yarn in yarns] + [yarn.diffuse_transmission_rgb for yarn in yarns])
    through = bool(diffuse[2:].any()) or max(yarn.width for yarn in yarns) < 1.0
    other_side = queries.wi[:, 2] * queries.wo[:, 2] <= 0.0
    for behind in (False, True):
        rows = np.flatnonzero(((queries.wo[:, 2] < 0.0) == behind) & (through | ~other_side))
        if not rows.size:
            continue
        seen = queries.take(rows)
        seen, side = (seen.turned(), fabric.back()) if behind else (seen, fabric)
        if not through:
            result[rows, :2] = bounced(plain.of(side), seen.wi, seen.wo, diffuse[:2])
            continue
        light = bounced(of_both_sides.of(side), seen.wi, seen.wo, diffuse)
        crossed = other_side[rows, None, None]
        result[rows, :2] = np.where(crossed, light[:, 2:], light[:, :2])
        result[rows, 2:] = np.where(crossed, light[:, :2] * diffuse[:2], light[:, 2:] * diffuse[2:])
    return result
