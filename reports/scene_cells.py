"""Rows of the tables of scenes."""

from __future__ import annotations

from typing import Any, Final

import pandas as pd

from reports.cells import Row, groups, row_of
from reports.numbers import fixed, fixed_to, percent, scientific, signed, times
from reports.summary import rows

SCENE: Final = (
    "colour",
    "MSE",
    "× lower",
    "PSNR",
    "SSIM",
    "FLIP",
    "HDR-FLIP",
    "ΔE",
    "flicker",
    "excess energy",
    "not its own",
    "ms a frame",
)
"""Columns of `scene_rows` after the method."""


def scene_rows(table: pd.DataFrame) -> dict[str, list[Row]]:
    """Return for each scene the rows of its table, in groups; times on the front are marked."""
    result: dict[str, list[Row]] = {}
    for scene, group in table.groupby("scene", sort=False) if len(table) else ():
        lines = []
        for row in rows(group):
            colour = percent(row.colour_rrmse) if row.colour_rrmse > 0 else "in the noise"
            cells: list[Any] = [colour, scientific(row.mse), times(row.ratio), fixed_to(row.psnr, 1)]
            cells += [fixed(value) for value in (row.ssim, row.flip_ldr, row.flip_hdr)]
            cells += [fixed_to(row.delta_e, 2), signed(row.flicker), signed(row.excess_energy)]
            cells += [percent(row.fallback_share, 0), {"text": fixed_to(row.frame_time, 1), "best": bool(row.front)}]
            lines.append(row_of(row.method, row.setting) | {"cells": cells})
        result[str(scene)] = groups(lines)
    return result
