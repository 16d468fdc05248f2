"""One table of a cloth: light of the second bounce and of all further ones, whatever the colours.

With diffuse colours k_w, k_f on the diagonal of k, the light that is seen on family a after two bounces and more is
k_a g_a, for each channel

    g_a(wi, wo) = sum_b k_b (C2_ab(wi, wo)
                  + sum_c R_abc(wo) k_c (s(wi, wo) e_bc(wi) + m(wo) sum_d M_bcd [k (1 - M' k)^-1 e'(wi)]_d))

The second bounce is exact, up to the noise of walks (`walks`). In the third the factor s is about 1; it makes the sum
over the families right, and so does m in the fourth. All later ones are a geometric series in the cloth's own
transfers. Each C2_ab is a sum of RANK products of a function of the viewer and one of the light, and s of
`RANK_OF_THIRD`, the largest of a singular value decomposition. All functions are known on a grid of directions and
linear between.

With light that comes through yarns and gaps, a to d have two ways each and two faces, the sun two sides (`walks`).
"""

import math
from typing import Final, NamedTuple

import numpy as np

from pipeline.analytic.bounces.walks import transport
from pipeline.compiled.arrays import Float32, Float64
from pipeline.compiled.decorators import inlined_kernel, kernel
from pipeline.truth.geometry.heightfield import height_field
from weaves.fabric import Fabric

RANK: Final = 10  # products that make up the light of second bounces: more are its noise
RANK_OF_THIRD: Final = 4  # products that make up the factor of third bounces
WALKS: Final = 1 << 16  # walks of a table
_ANGLES: Final = 16
_AZIMUTHS: Final = 24
_STEEPEST: Final = math.radians(89.0)  # angle of the last directions of the grid, whose functions hold beyond
_LEAST: Final = 1e-12  # least divisor: where nothing is seen or lit, the quotients are 0
_PASSES: Final = 3


class BounceTable(NamedTuple):
    """Light that the yarns of one side of a cloth give to each other.

    Colours, P of them, are those of `pipeline.analytic.bounces.walks.Transport`: k_d of warp and weft and, with two
    ways, k_dt; Q is P of one way, 2 P of two.
    """

    viewer: Float32
    """On the grid: the viewer's factors of C2 and of s, R, and m; of s and m one for each way of what is seen,
    (G, P P RANK + W RANK_OF_THIRD + P P P + W)."""
    light: Float32
    """The light's factors, e and e', in front, then behind; all but the factors of s are over the cosine of the light,
    (W G, P P RANK + W RANK_OF_THIRD + P Q + Q)."""
    transfers: Float64
    """M in P Q rows, and M': the share of what a family sends on in one way that has its light from each place,
    (P Q + Q, P)."""


def bounce_table(fabric: Fabric, walks: int = WALKS, through: bool = False) -> BounceTable:
    """Tabulate the side of a fabric that is seen from z > 0; its colours play no part. It takes some seconds.

    With light that comes `through` yarns and gaps, from either side, it takes about four times as long.
    """
    grid = _grid()
    back = height_field(fabric.back()) if through else None
    sums = transport(height_field(fabric), walks, grid, grid, back)
    count, seen, whole = len(grid), np.maximum(sums.seen, _LEAST)[:, None], np.maximum(sums.later[..., -1:], _LEAST)
    ways, places = sums.third.shape[1], sums.reached.shape[1]
    cosine, events = np.tile(grid[:, 2], ways), places * ways
    reached, later = sums.reached.reshape(count, -1) / seen, sums.later[..., :count] / whole / grid[:, 2]
    # What is reflected has its light from the side of its own face, what is transmitted from the other one.
    event = np.arange((places + 1) * events) % events
    behind = event // places ^ event // 2 % ways
    later = np.concatenate([np.where((behind == side)[:, None], later, 0.0) for side in range(ways)], axis=1)
    factors = []
    for k in range(places * places):
        second = sums.second.reshape(count, places * places, ways * count)[:, k] / seen / cosine
        # In units of each viewer's and each light's own mean, so that grazing ones count as much.
        of_viewer, of_light = (np.maximum(second.mean(axis=axis), _LEAST) for axis in (1, 0))
        viewers, lights = _products(second / of_viewer[:, None] / of_light, RANK)
        factors.append((viewers * of_viewer[:, None], lights * of_light[:, None]))
    transfers, further = sums.transfers / whole, []
    for way in range(ways):
        of_way = reached.reshape(count, ways, 2, places, places)[:, way].sum(axis=1)
        of_way = np.tile(of_way, ways).reshape(count, places * events)
        going_on = np.maximum(of_way @ transfers[:-events].sum(axis=1), _LEAST)
        series = np.maximum(of_way @ later[:-events], _LEAST)
        factors.append(_products(sums.third[:, way] / seen / cosine / series, RANK_OF_THIRD))
        further.append(sums.further[:, way, None] / seen / going_on[:, None])
    return BounceTable(
        np.concatenate([*(viewers for viewers, _ in factors), reached, *further], axis=1).astype(np.float32),
        np.concatenate([*(lights for _, lights in factors), later.T], axis=1).astype(np.float32),
        transfers,
    )


def _products(matrix: Float64, rank: int) -> tuple[Float64, Float64]:
    """Return columns (rows, rank) and columns (columns, rank): the matrix is about the sum of their products.

    The first singular vectors by a few passes of a block of twice as many [Halko2011Randomized].
    """
    block = np.random.default_rng(0).standard_normal((matrix.shape[1], 2 * rank))
    for _ in range(_PASSES):
        block = matrix.T @ np.linalg.qr(matrix @ block)[0]
        block = np.linalg.qr(block)[0]
    left, size, right = np.linalg.svd(matrix @ block, full_matrices=False)
    return left[:, :rank] * size[:rank], block @ right[:rank].T


def _grid() -> Float64:
    """Return the directions of the grid, (_ANGLES * _AZIMUTHS, 3), azimuths in the inner order."""
    angle = _STEEPEST * np.arange(_ANGLES) / (_ANGLES - 1.0)
    azimuth = 2.0 * np.pi * np.arange(_AZIMUTHS) / _AZIMUTHS
    sine, z = np.sin(angle)[:, None], np.broadcast_to(np.cos(angle)[:, None], (_ANGLES, _AZIMUTHS))
    return np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), z], axis=-1).reshape(-1, 3)


def bounced(table: BounceTable, wi: Float32, wo: Float32, colours: Float64) -> Float64:
    """Return light of N pairs of directions before the colours of what is seen, wo.z > 0: (N, P, 3).

    Colours, (P, 3), are k_d of warp and weft and, for a table of light that comes through, k_dt of both. The light
    that is seen is the sum over all P of colour times result. A table without such light needs wi.z > 0.
    """
    rows, places = len(wi), table.transfers.shape[1]
    ways, events = places // 2, places * places // 2
    second, reached = np.empty((rows, places, places)), np.empty((rows, places, places, places))
    later = np.empty((rows, ways, (places + 1) * events))
    scratch = (np.empty(columns.shape[1]) for columns in (table.viewer, table.light))
    _read(table, wi, wo, second, reached, later, *scratch)
    result = np.einsum("nab,bx->nax", second, colours)
    event = np.arange(events)
    transfers = np.tile(table.transfers, ways)
    for channel in range(colours.shape[1]):
        k = colours[:, channel]
        of_event = k[event // places * 2 + event % 2]
        going_on = np.linalg.inv(np.eye(events) - transfers[-events:] * of_event)
        series = transfers[:-events] * of_event @ going_on
        for way in range(ways):
            own = later[:, way]
            lit = (own[:, :-events] + own[:, -events:] @ series.T).reshape(rows, places, events)
            seen = slice(2 * way, 2 * way + 2)
            result[:, seen, channel] += np.einsum("nabc,b,c,nbc->na", np.tile(reached[:, seen], ways), k, of_event, lit)
    return np.asarray(np.maximum(result, 0.0))


@kernel
def _read(
    table: BounceTable, wi: Float32, wo: Float32, second: Float64, reached: Float64, later: Float64, viewer: Float64,
    light: Float64,
) -> None:  # fmt: skip
    """Write C2, R, s e and m e' of pairs of directions; `viewer` and `light` are scratch."""
    places, ways, rows = second.shape[1], later.shape[1], later.shape[2]
    factors = places * places * RANK
    products = factors + ways * RANK_OF_THIRD
    shares = products + places * places * places
    directions = len(table.viewer)
    for row in range(len(wi)):
        _interpolate(table.viewer, wo[row, 0], wo[row, 1], wo[row, 2], viewer)
        side = table.light[directions:] if wi[row, 2] < 0.0 else table.light[:directions]
        _interpolate(side, wi[row, 0], wi[row, 1], abs(wi[row, 2]), light)
        cosine = abs(wi[row, 2])
        for k in range(places * places):
            second[row, k // places, k % places] = cosine * _product(viewer, light, k * RANK, (k + 1) * RANK)
        for k in range(places * places * places):
            a, b = k // places // places, k // places % places
            reached[row, a, b, k % places] = viewer[products + k]
        for way in range(ways):
            begin = factors + way * RANK_OF_THIRD
            factor = max(_product(viewer, light, begin, begin + RANK_OF_THIRD), 0.0)
            for k in range(rows):
                own = factor if k < rows - rows // (places + 1) else viewer[shares + way]
                later[row, way, k] = own * cosine * light[products + k]


@inlined_kernel
def _product(viewer: Float64, light: Float64, first: int, last: int) -> float:
    total = 0.0
    for r in range(first, last):
        total += viewer[r] * light[r]
    return total


@kernel
def _interpolate(values: Float32, x: float, y: float, z: float, result: Float64) -> None:
    """Write the values of a grid of directions at one of them."""
    angle = math.acos(min(z, 1.0)) / _STEEPEST * (_ANGLES - 1.0)
    ring = min(int(angle), _ANGLES - 2)
    outer = min(angle - ring, 1.0)
    turn = math.atan2(y, x) / (2.0 * math.pi) * _AZIMUTHS
    before = math.floor(turn)
    place, column = turn - before, int(before) % _AZIMUTHS
    following = (column + 1) % _AZIMUTHS
    for c in range(len(result)):
        inside = values[ring * _AZIMUTHS + column, c] * (1.0 - place) + values[ring * _AZIMUTHS + following, c] * place
        ring_out = (ring + 1) * _AZIMUTHS
        outside = values[ring_out + column, c] * (1.0 - place) + values[ring_out + following, c] * place
        result[c] = inside * (1.0 - outer) + outside * outer
