"""Weights of the fixed nodes under a wide footprint: a sum of waves, or of the Gaussian over all its images.

A Gaussian along the axes is a product: one outer product of densities (axis_densities) for every touched cell and
group. A rotated one is a mixture of these (pipeline.truth.footprint.mixture); waves take any Gaussian.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from pipeline.analytic.soft_nodes.groups import COLUMNS
from pipeline.analytic.soft_nodes.look import Look
from pipeline.analytic.soft_nodes.nodes import BLOCK_NODES, GROUP_FAMILY, LINES, RULE_X, RULE_Y, START
from pipeline.analytic.soft_nodes.waves import HIGHEST, TOGETHER, faintest
from pipeline.compiled.arrays import Float32, Index
from pipeline.compiled.decorators import fast_kernel, kernel
from pipeline.compiled.float32 import remaining
from pipeline.truth.geometry.heightfield import WEFT

_0, _1, _2 = np.float32(0.0), np.float32(1.0), np.float32(2.0)
_TURN = np.float32(2.0 * math.pi)
_DAMPING = np.float32(2.0 * math.pi**2)
_FAINTEST = np.float32(faintest(1.0) ** 2)


@kernel
def waves_kept(size: Float32, narrowest: np.float32) -> int:
    """Return how many waves are not faint under a Gaussian of a least deviation, a multiple of TOGETHER."""
    last, count = _FAINTEST / (narrowest * narrowest), 0
    while count < len(size) and size[count] < last:
        count += TOGETHER
    return count


@fast_kernel
def wave_weights(
    waves: Index,
    nodes: Float32,
    evenly: Float32,
    look: Look,
    count: int,
    repeat: Index,
    turns: Float32,
    phases: Float32,
    weight: Float32,
) -> None:
    """Write the weights of all nodes as a sum of the first `count` waves, a multiple of TOGETHER.

    `turns` and `phases` are scratch.
    """
    ends, picks = np.float32(repeat[0]), np.float32(repeat[1])
    x, y = np.float32(look.x), np.float32(look.y)
    for axis in range(2):
        angle = _TURN * (x / ends if axis == 0 else y / picks)
        cosine, sine = np.cos(angle), np.sin(angle)
        turns[2 * axis, 0], turns[2 * axis + 1, 0] = _1, _0
        for m in range(HIGHEST):
            p, q = turns[2 * axis, m], turns[2 * axis + 1, m]
            turns[2 * axis, m + 1], turns[2 * axis + 1, m + 1] = p * cosine - q * sine, p * sine + q * cosine
    for h in range(count):
        m, n = waves[h, 0], waves[h, 1]
        of_x, of_y = np.float32(m) / ends * look.dx, np.float32(n) / picks * look.dy
        damping = remaining(_DAMPING * (of_x * of_x + of_y * of_y + _2 * look.rho * of_x * of_y))
        cos_x, sin_x, cos_y, sin_y = turns[0, m], turns[1, m], turns[2, abs(n)], turns[3, abs(n)]
        sin_y = -sin_y if n < 0 else sin_y
        own_phase, at = phases[h // TOGETHER], 2 * (h % TOGETHER)
        own_phase[at] = damping * (cos_x * cos_y - sin_x * sin_y)
        own_phase[at + 1] = damping * (sin_x * cos_y + cos_x * sin_y)
    for b in range(len(weight)):
        for k in range(BLOCK_NODES):
            weight[b, k] = _1
        # Several waves at a time: sums stay in registers.
        own = weight[b]
        for g in range(count // TOGETHER):
            part, phase = nodes[b, g], phases[g]
            p0, p1, p2, p3, p4, p5, p6, p7 = (
                phase[0], phase[1], phase[2], phase[3], phase[4], phase[5], phase[6], phase[7]
            )  # fmt: skip
            for k in range(BLOCK_NODES):
                own[k] += (
                    p0 * part[0, k] + p1 * part[1, k] + p2 * part[2, k] + p3 * part[3, k]
                    + p4 * part[4, k] + p5 * part[5, k] + p6 * part[6, k] + p7 * part[7, k]
                )  # fmt: skip
        for k in range(BLOCK_NODES):
            weight[b, k] = max(weight[b, k], _0) * evenly[b, k]


@fast_kernel
def product_weights(
    group_starts: npt.NDArray[np.uint32],
    cell_groups: npt.NDArray[np.uint32],
    groups: npt.NDArray[np.uint32],
    density_x: Float32,
    density_y: Float32,
    columns: npt.NDArray[np.uint32],
    rows: npt.NDArray[np.uint32],
    ends: int,
    share: np.float32,
    weight: Float32,
) -> None:
    """Add `share` times the weights of all nodes, (lines, COLUMNS): outer products over a group's touched cells."""
    for pick in rows:
        for end in columns:
            cell = pick * np.uint32(ends) + end
            for c in range(group_starts[cell], group_starts[cell + np.uint32(1)]):
                group = groups[cell_groups[np.uint32(c)]]
                # Rules follow each other, COLUMNS numbers each.
                at_x, at_y = group[RULE_X] * np.uint32(COLUMNS), group[RULE_Y] * np.uint32(COLUMNS)
                across, along = density_x[end, at_x : at_x + COLUMNS], density_y[pick, at_y : at_y + COLUMNS]
                if group[GROUP_FAMILY] == WEFT:
                    along, across = across, along
                start = group[START] // np.uint32(COLUMNS)
                for j in range(group[LINES]):
                    factor, own = share * along[j], weight[start + j]
                    for k in range(COLUMNS):
                        own[k] += factor * across[k]
