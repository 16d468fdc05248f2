"""Node tables of one resolution, kept for the last cloths, and the queries that they can answer.

A table answers queries about flat cloth with at most `TABLE_CELLS` different cells, for the default model and
footprints of at least `TABLE_SIGMA`. Rotated Gaussians are mixtures of Gaussians along the yarns (footprint.mixture),
without the very thin ones.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from threading import Lock
from typing import Final

import numpy as np

from pipeline.compiled.arrays import Index, Mask
from pipeline.truth.calibration import BEHIND_FACTORS, COARSE_TABLE, FINE_TABLE, FRONT_FACTORS, REFINED
from pipeline.truth.cloth import ClothSide, Raw, WideQueries
from pipeline.truth.footprint.mixture import FINE_LINE, Line, axes
from pipeline.truth.footprint.place import GAUSSIAN
from pipeline.truth.geometry.heightfield import HeightField
from pipeline.truth.geometry.pieces import different_cells
from pipeline.truth.node_table.answer import Requested, sum_rows
from pipeline.truth.node_table.build import ExactNodes, tabulate
from pipeline.truth.options import TABLE_CELLS, TABLE_SIGMA

FINE_NODES: Final = 32
"""Nodes per yarn spacing of the fine table, across and along; for a cloth of more than `_FEW` different cells, down to
three quarters of it."""

TABLE_AZIMUTHS: Final = 128
"""Directions in which the truth's tables hold horizons."""

NOT_REFINED: Final = (1.0, np.inf)
"""Relative and absolute standard error of an answer that is not refined."""

_FEW: Final = 8
_COARSE, _COARSEST, _COARSE_CELL = 24, 12, 44  # most and fewest nodes of a coarse table; their number for one cell
_KEPT: Final = 24  # tables of 1 to 5 MB: those of a benchmark with about a dozen cloths in turn

ALLOWED: Final = (
    f"flat cloth of at most {TABLE_CELLS} different cells, footprints of at least {TABLE_SIGMA:.3g} yarn spacings and "
    "not too thin, without parallax, and the default frame and shadows: take auto"
)
"""Queries that a table answers, as the end of a sentence."""


class NodeTable:
    """Tables of one resolution.

    Parameters
    ----------
    nodes : callable
        Nodes per yarn spacing for a number of different cells.
    azimuths : int
        Directions in which horizons are known.
    line : Line
        Points of the mixture that a rotated footprint is.
    stage : int
        Stage of the answers that are not refined (pipeline.truth.calibration).
    """

    def __init__(self, nodes: Callable[[int], int], azimuths: int, line: Line, stage: int = FINE_TABLE) -> None:
        self._nodes, self._azimuths, self._line, self._stage = nodes, azimuths, line, stage
        # The height field is kept beside its table: an identity is another object's once its own is gone.
        self._tables: dict[tuple[int, bool], tuple[HeightField, ExactNodes]] = {}
        self._building = Lock()

    def knows(self, cloth: ClothSide, columns: WideQueries) -> Mask:
        """Return which queries a table answers, (N,)."""
        other = cloth.choices.macro or not cloth.choices.shadows or cloth.parallax
        if other or different_cells(cloth.front) > TABLE_CELLS:
            return np.zeros(len(columns.u), np.bool_)
        known = (np.minimum(columns.sigma, columns.sigma_minor) >= TABLE_SIGMA) & (columns.curvature == 0.0)
        if (rotated := ~_axial(cloth, columns)).any():
            x, y, correlation = np.abs(axes(columns.sigma, columns.sigma_minor, columns.angle))
            blurred = np.sqrt(1.0 - correlation) * np.minimum(x, y) >= TABLE_SIGMA
            known &= ~rotated | (blurred & (correlation <= self._line.most) & (cloth.shape == GAUSSIAN))
        return np.asarray(known)

    def answer(
        self,
        cloth: ClothSide,
        columns: WideQueries,
        index: Index,
        relative_error: float,
        absolute_error: float,
        seed: int,
    ) -> Raw:
        """Answer queries that the table knows; nodes are refined where the standard error exceeds the requested one.

        `index` and `seed` name the random numbers of refined nodes.
        """
        table = self.table(cloth, bool((columns.wi[:, 2] < 0.0).any()))
        factors = ((side[self._stage], side[REFINED]) for side in (FRONT_FACTORS, BEHIND_FACTORS))
        requested = Requested(relative_error, absolute_error, *factors)
        answers = sum_rows(cloth, table, columns, index, requested, np.uint64(seed), self._line)
        return answers._replace(stage=np.where(answers.stage == REFINED, REFINED, self._stage))

    def table(self, cloth: ClothSide, behind: bool) -> ExactNodes:
        """Return the table of one side of a cloth, with horizons `behind` it if there is light."""
        front = cloth.front
        with self._building:
            for with_behind in (True, False):
                kept = self._tables.get((id(front), with_behind))
                if kept and kept[0] is front and (with_behind or not behind):
                    return kept[1]
            while len(self._tables) >= _KEPT:
                self._tables.pop(next(iter(self._tables)))
            table = tabulate(front, cloth.back, behind, self._nodes(different_cells(front)), self._azimuths)
            self._tables[id(front), behind] = front, table
        return table


def _axial(cloth: ClothSide, columns: WideQueries) -> Mask:
    """Return which footprints are round or lie along the axes."""
    along = columns.angle == 0.0
    if cloth.shape == GAUSSIAN:
        along |= columns.sigma == columns.sigma_minor
    return np.asarray(along)


def _fine_nodes(cells: int) -> int:
    """Return an even number of nodes: with more different cells, more borders average out."""
    return max(3 * FINE_NODES // 4, min(FINE_NODES, 2 * round(0.5 * FINE_NODES * math.sqrt(_FEW / cells))))


def _coarse_nodes(cells: int) -> int:
    """Return an even number of nodes for wide footprints, over which the errors of many nodes average out."""
    return max(_COARSEST, min(_COARSE, 2 * round(0.5 * _COARSE_CELL / math.sqrt(cells))))


FINE: Final = NodeTable(_fine_nodes, TABLE_AZIMUTHS, FINE_LINE)
"""The truth's table for any footprint."""

COARSE: Final = NodeTable(_coarse_nodes, TABLE_AZIMUTHS, FINE_LINE, COARSE_TABLE)
"""The truth's table for footprints of `cascade.WIDE`; at 1 % it costs a half to a fifth of the time."""
