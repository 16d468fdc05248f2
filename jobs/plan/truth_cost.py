"""Seconds that answers of the truth take on one core, for plans: from a fabric and the options alone.

Tables answer most rows. One is made for each fabric at the first row that needs it, and takes longer than thousands of
rows if the cloth has many different cells. The other rows are sampled, and so is all cloth that tables do not know.
Rays go on below gaps: points of open cloth take longer.
"""

from functools import lru_cache
from typing import Final, NamedTuple

from pipeline.truth.options import NARROWEST_RIMS, TABLE_CELLS, TruthOptions
from weaves.draft import Draft
from weaves.fabric import Fabric

SECONDS_A_POINT: Final = 5.5e-7  # one point of the truth, on one core of a server of 2021
_POINTS_A_ROW: Final = 1100  # for 2 % relative error, on average
_SAMPLED: Final = 0.15  # share of the points of sampling that `auto` takes where tables answer most rows
_ROW, _ROW_A_CELL, _MOST_CELLS = 1.2e-5, 3e-6, 8  # a row of a table: seconds, and more for each of the first cells
_TABLE_A_CELL, _OPEN_TABLE = 0.17, 7.0  # seconds of making one; the factor of open cloth
_OPEN_POINT: Final = 5.0  # a point takes longer by this for each yarn spacing of gap
_BOUNCES, _BOUNCES_THROUGH = 4.0, 16.0  # seconds of a table of light between yarns; of light through them too


class TruthCost(NamedTuple):
    """The truth of one fabric."""

    truth: TruthOptions
    fabric: Fabric

    def row(self, flat: bool = True) -> float:
        """Return the time of one row, of flat cloth or of curved.

        Points grow a little slower than 1 / error^2, within the limits of the options.
        """
        truth = self.truth
        points: float = min(max(_POINTS_A_ROW * (0.02 / truth.relative_error) ** 1.5, truth.min_count), truth.max_count)
        sampled = points * SECONDS_A_POINT * (1.0 + _OPEN_POINT * (1.0 - self._width))
        if not flat or not self._is_tabulated:
            return sampled
        looked_up = _ROW + _ROW_A_CELL * min(_cells(self.fabric.weave), _MOST_CELLS)
        return looked_up + (_SAMPLED * sampled if truth.estimator == "auto" else 0.0)

    @property
    def table(self) -> float:
        """The time in which the table of the fabric is made; 0 if there is none."""
        if not self._is_tabulated:
            return 0.0
        return _TABLE_A_CELL * _cells(self.fabric.weave) * (_OPEN_TABLE if self._width < 1.0 else 1.0)

    @property
    def bounces(self) -> float:
        """The time in which the table of light between yarns is made, which pictures of the fabric need."""
        through = any(any(yarn.diffuse_transmission_rgb) for yarn in (self.fabric.warp, self.fabric.weft))
        return _BOUNCES_THROUGH if through or self._width < 1.0 else _BOUNCES

    @property
    def _is_tabulated(self) -> bool:
        truth = self.truth
        known = truth.frame == "ply" and (truth.walls != "rim" or 0.5 * self._width >= NARROWEST_RIMS)
        return truth.estimator in ("auto", "node_table") and known and _cells(self.fabric.weave) <= TABLE_CELLS

    @property
    def _width(self) -> float:
        return min(self.fabric.warp.width, self.fabric.weft.width)


@lru_cache(maxsize=4096)
def _cells(draft: Draft) -> int:
    return draft.different_cells()
