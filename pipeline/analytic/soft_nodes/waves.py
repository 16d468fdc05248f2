"""Waves: the weights of all nodes under a wide Gaussian as a sum over the longest waves of the cloth.

The cells of a group form a lattice; a Gaussian of deviation s damps its wave of wave vector k by exp(-2 pi^2 s^2 k^2).
From some deviation on, only the few longest waves that differ between the groups of the cloth remain:

    weight(node) = evenly(node) (1 + sum 2 damping mean over its cells of cos(2 pi k (centre - place)))
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from pipeline.analytic.gauss_rules import Rule
from pipeline.analytic.soft_nodes.groups import PieceGroup
from pipeline.compiled.arrays import Float32, Index
from pipeline.truth.geometry.heightfield import WEFT

MOST_WAVES: Final = 48
"""Most waves kept. Where densities take less time they are taken instead (wide)."""

HIGHEST: Final = 10
"""Largest number of periods in a repeat, along x and along y."""

TOGETHER: Final = 4
"""Waves that are summed together: their number is a multiple of it."""

_FAINT = 0.01  # damping below which a wave is left out
_ABSENT = 1e-6  # amplitude of a wave that cancels over the cells of every group


class Waves(NamedTuple):
    """The longest waves, longest first.

    Attributes
    ----------
    periods : int64 (H, 2)
        In a repeat, along x and along y.
    size : float32 (H,)
        Squared wave number, 1/yarn spacings^2.
    nodes : float32 (H, 2, nodes)
        Twice the cosine and the sine at the nodes, mean over all cells of a group.
    enough_from : float
        Deviation from which on the missing waves are faint.
    """

    periods: Index
    size: Float32
    nodes: Float32
    enough_from: float


def faintest(deviation: float) -> float:
    """Return the wave number from which on a Gaussian damps waves so much that they are left out."""
    return math.sqrt(-math.log(_FAINT) / 2.0) / (math.pi * deviation)


def tabulate_waves(
    groups: Sequence[PieceGroup],
    rules: Sequence[tuple[Rule, Rule]],
    starts: Sequence[int],
    nodes: int,
    repeat: tuple[int, int],
) -> Waves:
    """Return the waves of a cloth.

    Parameters
    ----------
    groups, rules, starts
        Kinds, their rules across and along, and the first node of each.
    nodes : int
        Nodes of all groups, those that fill up blocks included.
    repeat : (ends, picks)
        Extent of the repeat.
    """
    ends, picks = repeat
    numbers = [(m, n) for m in range(HIGHEST + 1) for n in range(-HIGHEST, HIGHEST + 1) if m > 0 or n > 0]
    numbers.sort(key=lambda wave: (wave[0] / ends) ** 2 + (wave[1] / picks) ** 2)
    beyond = (HIGHEST + 1) / max(ends, picks)  # the least wave number missing from the list
    periods: list[tuple[int, int]] = []
    sizes, values = [], []
    for m, n in numbers:
        size = math.hypot(m / ends, n / picks)
        if size >= beyond:
            break
        wave = np.zeros(nodes, np.complex128)
        for group, (across, along), start in zip(groups, rules, starts, strict=True):
            x, y = (along, across) if group.piece.family == WEFT else (across, along)
            cells = np.array(group.cells, np.float64)
            mean = np.exp(2j * np.pi * (m * cells[:, 0] / ends + n * cells[:, 1] / picks)).mean()
            at_x, at_y = np.exp(2j * np.pi * m * x.places / ends), np.exp(2j * np.pi * n * y.places / picks)
            product = np.outer(at_x, at_y) if group.piece.family == WEFT else np.outer(at_y, at_x)
            # A line of nodes may be longer than the rule across; the rest of it weighs nothing.
            lines = np.zeros((group.lines, group.nodes // group.lines), np.complex128)
            lines[:, : product.shape[1]] = mean * product
            wave[start : start + group.nodes] = lines.ravel()
        if np.abs(wave).max() < _ABSENT:
            continue
        if len(periods) == MOST_WAVES:
            beyond = size
            break
        periods.append((m, n))
        sizes.append(size**2)
        values.append((2.0 * wave.real, 2.0 * wave.imag))
    while len(periods) % TOGETHER:
        periods.append((0, 0))
        sizes.append(0.0 if not sizes else sizes[-1])
        values.append((np.zeros(nodes), np.zeros(nodes)))
    return Waves(
        np.array(periods, np.int64).reshape(-1, 2),
        np.array(sizes, np.float32),
        np.array(values, np.float32).reshape(-1, 2, nodes),
        faintest(1.0) / beyond,
    )
