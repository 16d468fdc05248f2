"""Seconds that answers of the truth take on one core, for plans: from a fabric and the options alone.

Tables answer most rows. One is made for each fabric at the first row that needs it, and takes longer than thousands of
rows if the cloth has many different cells. The other rows are sampled, and so is all cloth that tables do not know.
Rays go on below gaps: points of open cloth take longer.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final

from pipeline.truth.options import NARROWEST_RIMS, TABLE_CELLS, TruthOptions
from weaves.draft import Draft
from weaves.fabric import Fabric

SECONDS_A_POINT: Final = 5.5e-7
"""One point of the truth, on one core of a server of 2021."""

_POINTS_A_ROW: Final = 1100  # for 2 % relative error, on average
_SAMPLED: Final = 0.15  # share of the points of sampling that `auto` takes where tables answer most rows
_ROW, _ROW_A_CELL, _MOST_CELLS = 1.2e-5, 3e-6, 8  # a row of a table: seconds, and more for each of the first cells
_TABLE_A_CELL, _OPEN_TABLE = 0.17, 4.5  # seconds of making one; the factor of open cloth
_OPEN_POINT: Final = 5.0  # a point takes longer by this for each yarn spacing of gap
_BOUNCES, _BOUNCES_THROUGH = 4.0, 16.0  # seconds of a table of light between yarns; of light through them too


def row_seconds(truth: TruthOptions, fabric: Fabric, flat: bool = True) -> float:
    """Return the time of one row, of flat cloth or of curved.

    Points grow a little slower than 1 / error^2, within the limits of the options.
    """
    wanted: float = _POINTS_A_ROW * (0.02 / truth.relative_error) ** 1.5
    points = min(max(wanted, truth.min_count), truth.max_count)
    sampled = points * SECONDS_A_POINT * (1.0 + _OPEN_POINT * (1.0 - _width(fabric)))
    if not flat or not _tabulated(truth, fabric):
        return sampled
    found = _ROW + _ROW_A_CELL * min(_cells(fabric.weave), _MOST_CELLS)
    return found + (_SAMPLED * sampled if truth.estimator == "auto" else 0.0)


def table_seconds(truth: TruthOptions, fabric: Fabric) -> float:
    """Return the time in which the table of a fabric is made; 0 if there is none."""
    if not _tabulated(truth, fabric):
        return 0.0
    return _TABLE_A_CELL * _cells(fabric.weave) * (_OPEN_TABLE if _width(fabric) < 1.0 else 1.0)


def bounce_seconds(fabric: Fabric) -> float:
    """Return the time in which a fabric's table of light between yarns is made, which pictures of it need."""
    through = any(any(yarn.diffuse_transmission_rgb) for yarn in (fabric.warp, fabric.weft))
    return _BOUNCES_THROUGH if through or _width(fabric) < 1.0 else _BOUNCES


def _tabulated(truth: TruthOptions, fabric: Fabric) -> bool:
    """Return whether tables answer most rows of a fabric."""
    known = truth.frame == "ply" and (truth.walls != "rim" or 0.5 * _width(fabric) >= NARROWEST_RIMS)
    return truth.estimator in ("auto", "node_table") and known and _cells(fabric.weave) <= TABLE_CELLS


@lru_cache(maxsize=4096)
def _cells(draft: Draft) -> int:
    return draft.different_cells()


def _width(fabric: Fabric) -> float:
    return min(fabric.warp.width, fabric.weft.width)
