"""Components of queries by the soft nodes, light in front or behind, and their bounds of energy.

The components of a patch hidden almost wholly fade to 0: the truth of most such patches is that nothing at all is seen.

Each component comes with its value without shadows of the light. That value is a mean of the point model over nodes
whose weights do not depend on wi; int (w_d <i.n_p> + (1 - w_d) i_z) / pi d(wi) over the viewer's side is at most 1 for
every node, so the diffuse components without shadows integrate to at most 1, and nothing below them makes light. The
specular ones, scattered once, stay far below 1 (weaves.yarn).
"""

import math
from typing import NamedTuple

import numpy as np

from pipeline.analytic.soft_nodes import shade
from pipeline.analytic.soft_nodes.answer import query_sums
from pipeline.analytic.soft_nodes.nodes import SoftNodeTable
from pipeline.compiled.arrays import Float32
from pipeline.compiled.decorators import fused_kernel
from pipeline.truth.query import Queries

_1 = np.float32(1.0)
_INVERSE_PI = np.float32(1.0 / math.pi)


class Reading(NamedTuple):
    """Components of N queries, float32 (N, 4), and their bounds: the same without shadows of the light."""

    components: Float32
    bounds: Float32


@fused_kernel
def _assemble(sums: Float32, gaps: Float32, reading: Reading) -> None:
    """Turn the sums of both families into what is read of N queries."""
    components, bounds = reading
    for n in range(len(sums)):
        bare = sums[n, 0, shade.BARE_AREA] + sums[n, 1, shade.BARE_AREA] + gaps[n]
        area = max(gaps[n] + sums[n, 0, shade.AREA] + sums[n, 1, shade.AREA], shade.LEAST_SEEN * bare) + shade.TINY
        inverse, faded = _1 / area, area / (area + shade.FADED * bare)
        for f in range(2):
            own = sums[n, f]
            components[n, f] = faded * (own[shade.SPECULAR] * inverse)
            components[n, 2 + f] = faded * (own[shade.DIFFUSE] * (inverse * _INVERSE_PI))
            bounds[n, f] = own[shade.OPEN_SPECULAR] * (faded * inverse)
            bounds[n, 2 + f] = own[shade.OPEN_DIFFUSE] * (faded * (inverse * _INVERSE_PI))


def read_queries(table: SoftNodeTable, queries: Queries) -> Reading:
    """Read N queries, light and viewer in front; cloth is curved only if the table knows it."""
    sums, gaps = query_sums(table, queries)
    reading = Reading(*(np.empty((len(sums), 4), np.float32) for _ in Reading._fields))
    _assemble(sums, gaps, reading)
    return reading


def read_behind(table: SoftNodeTable, queries: Queries) -> Float32:
    """Return components and transparency of N queries, float32 (N, 5), the viewer in front and the light behind.

    The table knows light from behind; cloth is curved only if it knows that, too.
    """
    sums, gaps = query_sums(table, queries)
    bare = sums[:, :, shade.BARE_AREA].sum(axis=1) + gaps
    area = np.maximum(sums[:, :, shade.AREA].sum(axis=1) + gaps, shade.LEAST_SEEN * bare) + shade.TINY
    faded = (area / (area + shade.FADED * bare))[:, None]
    result = np.empty((len(area), 5), np.float32)
    result[:, :2] = faded * sums[:, :, shade.SPECULAR] / area[:, None]
    result[:, 2:4] = faded * sums[:, :, shade.DIFFUSE] / (math.pi * area[:, None])
    result[:, 4] = np.minimum((sums[:, :, shade.THROUGH].sum(axis=1) + gaps) / area, 1.0)
    return result
