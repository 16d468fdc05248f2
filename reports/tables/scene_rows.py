"""Rows of the tables of scenes: numbers with 95 % intervals and ranges over trainings; last the noise of the truth."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import pandas as pd

from reports.catalogue import METRICS
from reports.over_seeds import LEAST, MOST
from reports.tables.method_rows import Row, groups, row_of
from reports.tables.number_format import (
    NO_BREAK,
    NONE,
    beyond_noise,
    missing,
    percent,
    scientific,
    scientific_interval,
    shown,
    span,
    times,
)
from reports.tables.summary import rows


@dataclass(frozen=True)
class Column:
    """A column of the table of a scene."""

    title: str
    metric: str
    """Column of `summary.scene_table`."""
    worded: Callable[[float], str]
    floor: str = ""
    """Column of the error by the noise of the truth alone."""
    in_powers: bool = False
    """True if intervals are in powers of ten."""

    def interval(self, low: float, high: float) -> str:
        """Return an interval in words; empty where there is none."""
        if missing(low) or missing(high):
            return ""
        if self.in_powers:
            return scientific_interval(low, high)
        return " … ".join("0" if end <= 0 else self.worded(end).removesuffix(" %") for end in (low, high))


def _of_metric(metric: str, floor: str = "", in_powers: bool = False) -> Column:
    """Return the column of a metric: title, unit and format are those of the catalogue."""
    row = METRICS[metric]
    title = f"{row.title}, {row.unit}" if row.unit in ("dB", "JOD") else row.title
    return Column(title, metric, lambda value: shown(metric, value), floor, in_powers)


COLUMNS: Final = (
    Column("colour", "colour_rrmse", lambda value: beyond_noise(value, percent)),
    Column("MSE", "mse", lambda value: beyond_noise(value, scientific), "truth_noise", in_powers=True),
    Column(f"×{NO_BREAK}lower", "ratio", times),
    _of_metric("psnr", "psnr_floor"),
    _of_metric("ssim", "ssim_floor"),
    _of_metric("flip_ldr", "flip_ldr_floor"),
    _of_metric("flip_hdr", "flip_hdr_floor"),
    _of_metric("delta_e", "delta_e_floor"),
    _of_metric("flicker", in_powers=True),
    _of_metric("excess_energy"),
    _of_metric("fovvideovdp"),
    _of_metric("fallback_share"),
    _of_metric("frame_time"),
)
"""All columns; `scene_columns` leaves out those without numbers."""


def scene_columns(table: pd.DataFrame) -> list[Column]:
    """Return the columns of `scene_rows`: `COLUMNS`, without FovVideoVDP where it was not measured."""
    return [column for column in COLUMNS if column.metric != "fovvideovdp" or table[column.metric].notna().any()]


def scene_rows(table: pd.DataFrame) -> dict[str, dict[str, Any]]:
    """Return for each scene the rows of its table, in groups, and the row of the truth's noise.

    Times on the front of MSE and time are marked.
    """
    columns, result = scene_columns(table), {}
    for scene, group in table.groupby("scene", sort=False) if len(table) else ():
        lines: list[Row] = []
        for row in rows(group):
            cells = [_cell(row, column) for column in columns]
            cells[-1]["best"] = bool(row.front)
            lines.append(row_of(row.method, row.setting) | {"cells": cells})
        noise = [column.worded(group[column.floor].mean()) if column.floor else NONE for column in columns]
        result[str(scene)] = {"groups": groups(lines), "noise": noise}
    return result


def _cell(row: Any, column: Column) -> Row:
    """Return a number, its interval and its range over trainings, which are empty where there are none."""
    low, high = (getattr(row, f"{column.metric}_{end}", math.nan) for end in ("low", "high"))
    text = column.worded(getattr(row, column.metric))
    least, most = (getattr(row, f"{column.metric}{end}", math.nan) for end in (LEAST, MOST))
    return {
        "text": text,
        "interval": column.interval(low, high),
        "range": span(scientific if column.in_powers else column.worded, least, most),
        "best": False,
    }
