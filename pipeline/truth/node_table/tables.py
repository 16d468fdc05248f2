"""Node tables of one resolution, kept for the last cloths, and the queries that they can answer.

A table answers queries about flat cloth with at most `TABLE_CELLS` different cells, for the default model and
footprints of at least `TABLE_SIGMA`. Rotated Gaussians are mixtures of Gaussians along the yarns (footprint.mixture),
without the very thin ones. A Gaussian of view rays must be wider than the distance of nodes as the viewer sees them.
"""

import math
from collections.abc import Callable
from itertools import product
from threading import Lock
from typing import Final

import numpy as np

from pipeline.compiled.arrays import Index, Mask
from pipeline.truth import options
from pipeline.truth.calibration import BEHIND_FACTORS, COARSE_TABLE, FINE_TABLE, FRONT_FACTORS, REFINED
from pipeline.truth.cloth import ClothSide, Raw, WideQueries
from pipeline.truth.footprint.mixture import FINE_LINE, Line, axes
from pipeline.truth.footprint.place import GAUSSIAN
from pipeline.truth.geometry.heightfield import BEND, BETA, RADIUS, HeightField
from pipeline.truth.geometry.pieces import different_cells
from pipeline.truth.node_table.answer import Requested, sum_rows
from pipeline.truth.node_table.build import ExactNodes, tabulate

FINE_NODES: Final = 32
"""Nodes per yarn spacing of the fine table, across and along; for a cloth of more than `_FEW` different cells, down to
`FEWEST_NODES`."""

TABLE_AZIMUTHS: Final = 128  # directions in which the truth's tables hold horizons

NOT_REFINED: Final = (1.0, np.inf)  # relative and absolute standard error of an answer that is not refined

_FEW: Final = 8
_COARSE, _COARSEST, _COARSE_CELL = 24, 12, 44  # most and fewest nodes of a coarse table; their number for one cell
_COARSE_RAYS: Final = 1.8  # below it, errors of the coarse table are larger than stated
_KEPT: Final = 24  # tables of 1 to 5 MB: those of a benchmark with about a dozen cloths in turn

ALLOWED: Final = (
    f"flat cloth of at most {options.TABLE_CELLS} different cells, footprints of at least {options.TABLE_SIGMA:.3g} "
    "yarn spacings and not too thin (with parallax: Gaussian ones, from a size on that grows with the viewer's angle), "
    "and the default frame and shadows: take auto"
)
"""Queries that a table answers, as the end of a sentence."""


class NodeTable:
    """Tables of one resolution.

    `nodes` gives the nodes per yarn spacing for a number of different cells, `azimuths` is the number of directions in
    which horizons are known, `line` the points of the mixture that a rotated footprint is, `stage` that of the answers
    that are not refined (pipeline.truth.calibration). `rays_resolved` is the smallest deviation of footprints of view
    rays, over the distance of nodes as they are seen, if that is more than `RAYS_RESOLVED`.
    """

    def __init__(
        self, nodes: Callable[[int], int], azimuths: int, line: Line, stage: int = FINE_TABLE, rays_resolved: float = 0
    ) -> None:
        self._nodes, self._azimuths, self._line, self._stage = nodes, azimuths, line, stage
        self._rays_resolved = rays_resolved
        # The height field is kept beside its table: an identity is another object's once its own is gone.
        self._tables: dict[tuple[int, bool, bool], tuple[HeightField, ExactNodes]] = {}
        self._building = Lock()

    def knows(self, cloth: ClothSide, columns: WideQueries) -> Mask:
        """Return which queries a table answers, (N,)."""
        other = cloth.choices.macro or not cloth.choices.shadows
        other |= cloth.parallax and cloth.shape != GAUSSIAN
        other |= cloth.choices.rims and bool(cloth.front.yarn[:, RADIUS].min() < options.NARROWEST_RIMS)
        if other or different_cells(cloth.front) > options.TABLE_CELLS:
            return np.zeros(len(columns.u), np.bool_)
        narrow = np.minimum(columns.sigma, columns.sigma_minor)
        known = (narrow >= options.TABLE_SIGMA) & (columns.curvature == 0.0)
        if cloth.parallax:
            resolved = max(self._rays_resolved, options.RAYS_RESOLVED["rim" if cloth.choices.rims else "left_out"])
            steepest = max(options.steepness(yarn[BETA], 2.0 * yarn[RADIUS], yarn[BEND]) for yarn in cloth.front.yarn)
            nodes = self._nodes(different_cells(cloth.front))
            known &= narrow >= resolved * options.seen_distance(steepest, columns.wo[:, 2], nodes)
        axial = columns.angle == 0.0
        if cloth.shape == GAUSSIAN:
            axial |= columns.sigma == columns.sigma_minor
        if not axial.all():
            x, y, correlation = np.abs(axes(columns.sigma, columns.sigma_minor, columns.angle))
            blurred = np.sqrt(1.0 - correlation) * np.minimum(x, y) >= options.TABLE_SIGMA
            known &= axial | (blurred & (correlation <= self._line.most) & (cloth.shape == GAUSSIAN))
        return np.asarray(known)

    def answer(
        self, cloth: ClothSide, columns: WideQueries, index: Index, relative: float, absolute: float, seed: int
    ) -> Raw:
        """Answer queries that the table knows; nodes are refined where the standard error exceeds the requested one.

        It is `relative` to the norm of the components, `absolute` in 1/sr. `index` and `seed` name random numbers.
        """
        table = self.table(cloth, bool((columns.wi[:, 2] < 0.0).any()))
        factors = ((side[self._stage], side[REFINED]) for side in (FRONT_FACTORS, BEHIND_FACTORS))
        requested = Requested(relative, absolute, *factors)
        answers = sum_rows(cloth, table, columns, index, requested, seed, self._line)
        return answers._replace(stage=np.where(answers.stage == REFINED, REFINED, self._stage))

    def table(self, cloth: ClothSide, behind: bool) -> ExactNodes:
        """Return the table of one side of a cloth, with horizons `behind` it if there is light, and walls if seen."""
        front, rims = cloth.front, cloth.choices.rims
        with self._building:
            for with_behind, with_rims in product((True, False), repeat=2):
                kept = self._tables.get((id(front), with_behind, with_rims))
                if kept and kept[0] is front and with_behind >= behind and with_rims >= rims:
                    return kept[1]
            while len(self._tables) >= _KEPT:
                self._tables.pop(next(iter(self._tables)))
            table = tabulate(front, cloth.back, behind, self._nodes(different_cells(front)), self._azimuths, rims)
            self._tables[id(front), behind, rims] = front, table
        return table


def _fine_nodes(cells: int) -> int:
    """Return an even number of nodes: with more different cells, more borders average out."""
    return max(options.FEWEST_NODES, min(FINE_NODES, 2 * round(0.5 * FINE_NODES * math.sqrt(_FEW / cells))))


def _coarse_nodes(cells: int) -> int:
    """Return an even number of nodes for wide footprints, over which the errors of many nodes average out."""
    return max(_COARSEST, min(_COARSE, 2 * round(0.5 * _COARSE_CELL / math.sqrt(cells))))


FINE: Final = NodeTable(_fine_nodes, TABLE_AZIMUTHS, FINE_LINE)  # the truth's table for any footprint

COARSE: Final = NodeTable(_coarse_nodes, TABLE_AZIMUTHS, FINE_LINE, COARSE_TABLE, _COARSE_RAYS)
"""The truth's table for footprints of `estimator.WIDE`; at 1 % it costs a half to a fifth of the time."""
