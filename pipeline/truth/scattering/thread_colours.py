"""Colours of the components where ends or picks differ in colour: the truth, by sampling.

Each component of a patch is a sum over the yarns in it. Its colour is the mean colour of their threads, each thread
weighted by its share of the component:

    f_P = sum_c colour_c component_c,    colour_c = sum_r N_rc k_r / sum_r N_rc

with the numerators N of a component over the threads r. Points of the footprint are those of the Owen-scrambled
estimator (monte_carlo), placed in the repeat of weave and colours together.
"""

import math
from itertools import product
from typing import NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float64, Index
from pipeline.compiled.decorators import allocating_kernel, kernel
from pipeline.truth.cloth import ClothSide, WideQueries, cloth_side, columns_of
from pipeline.truth.footprint.sequences import derive, owen_pair
from pipeline.truth.geometry.heightfield import GAP, WARP
from pipeline.truth.geometry.march import wrap
from pipeline.truth.monte_carlo import RANDOMISATIONS, place_in, query_directions, share_at
from pipeline.truth.options import Limits, TruthOptions
from pipeline.truth.query import Queries, validate
from weaves.fabric import Fabric


class ComponentColours(NamedTuple):
    """Colours of the components of N queries, linear sRGB."""

    mean: Float64  # colour of each component, in the order of `pipeline.truth.conventions.COMPONENTS`, (N, 4, 3)
    standard_error: Float64  # standard error that the colours bring into the patch BSDF, 1/sr, (N, 3)


class ThreadTable(NamedTuple):
    """Colours of the threads as kernels read them."""

    warp: Float64
    weft: Float64
    """Specular and diffuse colour of each end (pick) of the sequence, (n, 2, 3)."""
    ends: int
    picks: int
    """Repeat of weave and colours together."""


def _threads_of(fabric: Fabric, transmitted: bool) -> ThreadTable:
    """Return the colours of a fabric's threads; those of the diffuse components for light from one side or both."""
    warp, weft = (
        np.stack([threads.specular, threads.diffuse_transmission if transmitted else threads.diffuse], axis=1)
        for threads in fabric.thread_colours()
    )
    return ThreadTable(warp, weft, *fabric.repeat)


def component_colours(fabric: Fabric, queries: Queries, options: TruthOptions, seed: int) -> ComponentColours:
    """Return the colours of the components of queries about a fabric.

    Points are doubled until the standard error of the patch BSDF's colour is `options.relative_error` of its size.
    Parameters and errors are those of `pipeline.truth.estimator.estimate`; the estimator of the options plays no part.
    """
    validate(queries, parallax=options.parallax)
    rows = len(queries.u)
    found = ComponentColours(np.zeros((rows, 4, 3)), np.zeros((rows, 3)))
    behind, through = queries.wo[:, 2] < 0, queries.wi[:, 2] * queries.wo[:, 2] < 0
    for side, transmitted in product((False, True), repeat=2):
        index = np.flatnonzero((behind == side) & (through == transmitted))
        if not index.size:
            continue
        threads = _threads_of(fabric, transmitted)
        if fabric.colours is None:
            found.mean[index] = np.stack([threads.warp[0], threads.weft[0]], axis=1).reshape(4, 3)
            continue
        cloth, columns = cloth_side(fabric, options, side), columns_of(queries.take(index), side)
        found.mean[index], found.standard_error[index] = _sample_colours(
            cloth, columns, index, threads, options.limits, np.uint64(seed)
        )
    return found


@allocating_kernel
def _sample_colours(
    cloth: ClothSide, columns: WideQueries, index: Index, threads: ThreadTable, limits: Limits, seed: np.uint64
) -> tuple[Float64, Float64]:
    """Return the colours of every row's components (N, 4, 3), and the standard error in the patch BSDF (N, 3)."""
    rows = len(index)
    means, errors = np.zeros((rows, 4, 3)), np.zeros((rows, 3))
    # Numerators of the components, the same with colours, and the denominator.
    plain, coloured = np.zeros((RANDOMISATIONS, 4)), np.zeros((RANDOMISATIONS, 4, 3))
    area = np.zeros(RANDOMISATIONS)
    for row in range(rows):
        key = derive(seed, index[row])
        plain[:], coloured[:], area[:] = 0.0, 0.0, 0.0
        done, target = 0, limits.min_count // RANDOMISATIONS
        while True:
            for r in range(RANDOMISATIONS):
                _add_points(cloth, columns, row, threads, derive(key, r), done, target, plain[r], coloured[r], area[r:])
            done = target
            size, error = _colours(threads, plain, coloured, area, means[row], errors[row])
            if error <= limits.relative_error * size or done * RANDOMISATIONS >= limits.max_count:
                break
            target = 2 * done
    return means, errors


@kernel
def _add_points(
    cloth: ClothSide, columns: WideQueries, row: int, threads: ThreadTable, randomisation: np.uint64, first: int,
    last: int, plain: Float64, coloured: Float64, area: Float64,
) -> None:  # fmt: skip
    """Add the points from `first` to `last` of a randomisation to its sums; area[0] is the denominator."""
    directions = query_directions(columns, row)
    picks, ends = cloth.front.top.shape
    for k in range(first, last):
        a, b = owen_pair(randomisation, k)
        x, y, weight = place_in(float(threads.ends), float(threads.picks), columns, row, cloth.shape, a, b)
        family, seen, specular, diffuse, _, moved_x, moved_y = share_at(
            cloth, wrap(x, float(ends)), wrap(y, float(picks)), directions
        )
        x, y = wrap(x + moved_x, float(threads.ends)), wrap(y + moved_y, float(threads.picks))
        area[0] += weight * seen
        if family == GAP:
            continue
        sequence, number = (threads.warp, int(x)) if family == WARP else (threads.weft, int(y))
        thread = sequence[number % len(sequence)]
        plain[family] += weight * specular
        plain[2 + family] += weight * diffuse
        for c in range(3):
            coloured[family, c] += weight * specular * thread[0, c]
            coloured[2 + family, c] += weight * diffuse * thread[1, c]


@kernel
def _colours(
    threads: ThreadTable, plain: Float64, coloured: Float64, area: Float64, mean: Float64, error: Float64
) -> tuple[float, float]:
    """Write the colours of the components and the standard error; return the norms of the patch's colour and of it."""
    whole = area.sum()
    for q in range(4):
        total = plain[:, q].sum()
        sequence = threads.warp if q % 2 == WARP else threads.weft
        for c in range(3):
            # A component of which no point was seen has the mean colour of all its threads.
            mean[q, c] = coloured[:, q, c].sum() / total if total > 0.0 else sequence[:, q // 2, c].mean()
    if whole <= 0.0:
        error[:] = 0.0
        return 0.0, 0.0
    size, doubt = 0.0, 0.0
    for c in range(3):
        spread, value = 0.0, 0.0
        for r in range(RANDOMISATIONS):
            residual = 0.0
            for q in range(4):
                residual += coloured[r, q, c] - mean[q, c] * plain[r, q]
                value += coloured[r, q, c]
            spread += residual * residual
        error[c] = math.sqrt(spread * RANDOMISATIONS / (RANDOMISATIONS - 1)) / whole
        size += (value / whole) ** 2
        doubt += error[c] ** 2
    return math.sqrt(size), math.sqrt(doubt)
