"""Features of a query for a network, light in front; components by the soft nodes alone, light in front or behind.

Ratios and bounded numbers only. Mirror images of a query, x -> -x and y -> -y, are the same query of a mirrored cloth:
the half vector is brought to x, y >= 0, and what remains of the cloth is the sense of its twists. Exchanging x and y
exchanges warp and weft: that is a permutation of the features and of the components.

The components of a patch hidden almost wholly fade to 0: the truth of most such patches is that nothing at all is seen.

Where walls are most of what is seen, sums are many times the bare ones, which know no walls: shares of the bare sums
are cut off at 2, so that no feature is far from those that a network was trained on.

Each component comes with its value without shadows of the light. That value is a mean of the point model over nodes
whose weights do not depend on wi; int (w_d <i.n_p> + (1 - w_d) i_z) / pi d(wi) over the viewer's side is at most 1 for
every node, so the diffuse components without shadows integrate to at most 1, and nothing below them makes light. The
specular ones, scattered once, stay far below 1 (weaves.yarn).

    0-7, 8-15   of warp, of weft: share of the area seen; how much is seen of the bare area, diffuse and specular; how
                much of the latter two is in doubt; specular and diffuse component
    16-24       wi, wo; slopes of the half vector; wi.wo
    25-27       how much of the footprint is seen; its size; how much is seen, resolving patches almost hidden
    28-29       senses of the twists
    30-39       of the cloth alone, warp and weft by turns: roughness, bend, relief, length of floats, width
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from pipeline.analytic.soft_nodes.answer import SMALLEST, query_sums
from pipeline.analytic.soft_nodes.nodes import SoftNodeTable
from pipeline.analytic.soft_nodes.shade import (
    AREA,
    BARE_AREA,
    BARE_DIFFUSE,
    BARE_SPECULAR,
    DIFFUSE,
    DIFFUSE_DOUBT,
    FADED,
    LEAST_SEEN,
    OPEN_DIFFUSE,
    OPEN_SPECULAR,
    SPECULAR,
    SPECULAR_DOUBT,
    THROUGH,
    TINY,
)
from pipeline.compiled.arrays import Float32
from pipeline.compiled.decorators import fast_kernel
from pipeline.truth.footprint.mixture import footprints
from pipeline.truth.geometry.heightfield import ALPHA, BEND, BETA, RADIUS, SIN_TWIST
from pipeline.truth.query import Queries

FEATURES: Final = 40
"""Features of a query."""

OF_QUERY: Final = 30
"""Number of leading features that depend on the query; the others are the same for all queries of a cloth."""

EXCHANGED: Final = np.array(
    [*range(8, 16), *range(8), 17, 16, 18, 20, 19, 21, 23, 22, 24, 25, 26, 27, 29, 28]
    + [k + 1 - 2 * (k % 2) for k in range(OF_QUERY, FEATURES)]
)
"""Index of the feature that each one becomes when x and y are exchanged."""

EXCHANGED_SIGN: Final = np.array([-1.0 if k in (28, 29) else 1.0 for k in range(FEATURES)], np.float32)
"""Factor of each feature under that exchange: a mirror reverses the twists."""

_0, _1, _2 = np.float32(0.0), np.float32(1.0), np.float32(2.0)
_STEEPEST = np.float32(3.0)  # slope of a half vector
_MOST_SEEN = np.float32(2.0)  # of the bare sums
_INVERSE_PI = np.float32(1.0 / math.pi)
_DARK, _SMALL, _HIDDEN = np.float32(0.05), np.float32(0.1), np.float32(0.02)  # where bounded numbers reach a half


class Reading(NamedTuple):
    """Features and components of N queries.

    Attributes
    ----------
    features : float32 (N, FEATURES)
        For the network.
    components : float32 (N, 4)
        By the soft nodes alone.
    bounds : float32 (N, 4)
        The same without shadows of the light.
    """

    features: Float32
    components: Float32
    bounds: Float32


@fast_kernel
def _assemble(
    found: Float32,
    gaps: Float32,
    size: Float32,
    wi: Float32,
    wo: Float32,
    cloth: Float32,
    twists: Float32,
    reading: Reading,
) -> None:
    """Turn sums into what is read of N queries."""
    features, components, bounds = reading
    for n in range(len(found)):
        bare = found[n, 0, BARE_AREA] + found[n, 1, BARE_AREA] + gaps[n]
        area = max(found[n, 0, AREA] + found[n, 1, AREA] + gaps[n], LEAST_SEEN * bare) + TINY
        inverse, faded = _1 / area, area / (area + FADED * bare)
        ix, iy, iz, ox, oy, oz = wi[n, 0], wi[n, 1], wi[n, 2], wo[n, 0], wo[n, 1], wo[n, 2]
        hx, hy, sense = ix + ox, iy + oy, _1
        if hx < _0:
            ix, ox, hx, sense = -ix, -ox, -hx, -sense
        if hy < _0:
            iy, oy, hy, sense = -iy, -oy, -hy, -sense
        slope = _1 / (iz + oz)
        row = features[n]
        for f in range(2):
            own = found[n, f]
            specular, diffuse = own[SPECULAR] * inverse, own[DIFFUSE] * inverse * _INVERSE_PI
            components[n, f], components[n, 2 + f] = faded * specular, faded * diffuse
            bounds[n, f] = faded * own[OPEN_SPECULAR] * inverse
            bounds[n, 2 + f] = faded * own[OPEN_DIFFUSE] * inverse * _INVERSE_PI
            per_diffuse, per_specular = _1 / (own[BARE_DIFFUSE] + TINY), _1 / (own[BARE_SPECULAR] + TINY)
            k = 8 * f
            row[k] = own[AREA] * inverse
            row[k + 1] = min(own[AREA] / (own[BARE_AREA] + TINY), _MOST_SEEN)
            row[k + 2] = min(own[DIFFUSE] * per_diffuse, _MOST_SEEN)
            row[k + 3] = min(own[SPECULAR] * per_specular, _MOST_SEEN)
            # A node that shows walls beside its whole box takes from the sum of doubts.
            row[k + 4] = min(max(own[DIFFUSE_DOUBT] * per_diffuse * _2, _0), _1)
            row[k + 5] = min(max(own[SPECULAR_DOUBT] * per_specular * _2, _0), _1)
            row[k + 6] = specular / (specular + _DARK)
            row[k + 7] = diffuse / (diffuse + _DARK)
        row[16], row[17], row[18], row[19], row[20], row[21] = ix, iy, iz, ox, oy, oz
        row[22], row[23] = min(hx * slope, _STEEPEST), min(hy * slope, _STEEPEST)
        row[24] = ix * ox + iy * oy + iz * oz
        row[25] = min(area / (bare + TINY), _MOST_SEEN)
        row[26] = size[n] / (size[n] + _SMALL)
        root = np.sqrt(area / (bare + TINY))
        row[27] = root / (root + _HIDDEN)
        row[28], row[29] = sense * twists[0], sense * twists[1]
        for k in range(FEATURES - OF_QUERY):
            row[OF_QUERY + k] = cloth[k]


def cloth_features(table: SoftNodeTable) -> Float32:
    """Return the features that are the same for all queries of a cloth, float32 (FEATURES - OF_QUERY,)."""
    yarn = table.yarn.astype(np.float64)
    by_family = [
        np.log(yarn[:, ALPHA]) / 2.0 + 0.5,
        yarn[:, BEND],
        yarn[:, BETA] - 1.0,
        np.log(table.float_length),
        2.0 * yarn[:, RADIUS] - 1.0,
    ]
    return np.ascontiguousarray(np.stack(by_family), np.float32).ravel()


def read_queries(table: SoftNodeTable, queries: Queries) -> Reading:
    """Read N queries, light and viewer in front; cloth is curved only if the table knows it."""
    found, gaps = query_sums(table, queries)
    # Of the footprint that kernels see, whose correlation has a limit.
    *_, x, y, correlation = footprints(queries, SMALLEST)
    size = np.sqrt(x * y * np.sqrt((_1 - correlation) * (_1 + correlation)))
    wi, wo = (np.ascontiguousarray(column, np.float32) for column in (queries.wi, queries.wo))
    reading = Reading(*(np.empty((len(wi), width), np.float32) for width in (FEATURES, 4, 4)))
    twists = np.arcsin(np.clip(table.yarn[:, SIN_TWIST], -1.0, 1.0))
    _assemble(found, gaps, size, wi, wo, cloth_features(table), twists, reading)
    return reading


def read_behind(table: SoftNodeTable, queries: Queries) -> Float32:
    """Return components and transparency of N queries, float32 (N, 5), the viewer in front and the light behind.

    The table knows light from behind; cloth is curved only if it knows that, too.
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
