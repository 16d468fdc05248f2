"""Headline sentences of a page: the paper's comparison with the numbers measured here.

A sentence is made only where both of its numbers were measured.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Any, Final

import pandas as pd

from reports.over_fabrics import over_unseen
from reports.over_seeds import LEAST, MOST
from reports.record import TRUTH
from reports.tables.number_format import display
from reports.tables.summary import BASELINE, PAPER, rows

BOUNDED: Final = "bounded"
"""Setting of a network under the energy bound (`pipeline.models.bounded`)."""


def headline(method: str, setting: str, errors: pd.DataFrame, timing: pd.DataFrame, paper: bool = True) -> str:
    """Return the paper's sentence with our numbers, and with the paper's; empty if there is no ratio to print.

    A mean over trainings has its range; a single training is called one. On several unseen fabrics the ratio is the
    geometric mean, with its 95 % interval over fabrics.
    """
    found = errors[(errors["method"] == method) & (errors["setting"] == setting) & errors["ratio"].notna()]
    parts = [_part(row) for row in rows(found)]
    if not parts:
        return ""
    (first, where), *others = parts
    more = "".join(f" and {ratio} on {fabrics}" for ratio, fabrics in others)
    times = timing[(timing["method"] == method) & (timing["setting"] == setting)]["time_ratio"]
    cost = f", at {times.iloc[0]:.2g}× its time" if len(times) and math.isfinite(times.iloc[0]) else ""
    lower, faster = PAPER
    name = display(method, setting)
    said = f"{name[0].upper()}{name[1:]} reaches {first} than point sampling at 2 points on {where}{more}{cost}"
    said += " (one training)" if found["seeds"].iloc[0] == 1 else ""
    return f"{said}; the paper reports {lower}× at {faster}× on its own scene and GPU." if paper else f"{said}."


def learnt(errors: pd.DataFrame, untrained: Collection[str] = (BASELINE[0],)) -> list[tuple[str, str]]:
    """Return the setting of each method that the headline names.

    It is the form under the energy bound where that was measured: its error on validation cloths is lower. Otherwise
    it is the first. The truth, and methods that nothing is trained for, are left out.
    """
    settings: dict[str, list[str]] = {}
    for method, setting in zip(errors["method"], errors["setting"], strict=True):
        settings.setdefault(method, []).append(setting)
    return [
        (method, BOUNDED if BOUNDED in found else found[0])
        for method, found in settings.items()
        if method not in untrained and method != TRUTH
    ]


def _comparison(ratio: float) -> str:
    return f"{_number(ratio)}× lower MSE" if ratio >= 1 else f"{_number(1 / ratio)}× higher MSE"


def _part(row: Any) -> tuple[str, str]:
    """Return the comparison of a ratio, and the fabrics it is of."""
    where = _fabrics(row.fabrics, row.role)
    if not over_unseen(row):
        return _comparison(row.ratio) + _range(row, "ratio"), where
    low, high = _ends(row.ratio_fabrics, row.ratio_fabrics_low, row.ratio_fabrics_high)
    where += f" (geometric mean, 95 % interval over fabrics {low}× to {high}×)"
    return _comparison(row.ratio_fabrics) + _range(row, "ratio_fabrics"), where


def _range(row: Any, column: str) -> str:
    """Return the range of a ratio over trainings; empty where there are not several."""
    least, most = getattr(row, column + LEAST), getattr(row, column + MOST)
    if not math.isfinite(least):
        return ""
    low, high = _ends(getattr(row, column), least, most)
    return f" ({low}× to {high}× over {row.seeds} trainings)"


def _ends(ratio: float, low: float, high: float) -> tuple[str, str]:
    """Return the ends of a ratio's interval; of a ratio below 1 those of its inverse, in rising order."""
    ends = (low, high) if ratio >= 1 else (1 / high, 1 / low)
    return _number(ends[0]), _number(ends[1])


def _number(value: float) -> str:
    return f"{value:.2g}" if value < 1 else f"{value:.1f}" if value < 100 else f"{value:,.0f}"


def _fabrics(count: int, role: str) -> str:
    return f"one {role} fabric" if count == 1 else f"the {count} {role} fabrics"
