"""Rows of the tables about the ground truth itself: its speed, accuracy, bias and effort, its sampler, its rounding."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from pipeline.truth.conventions import COMPONENTS
from reports.record import Record
from reports.tables.number_format import NONE, missing, percent, plain, times
from reports.truth.accuracy import Accuracy
from reports.truth.bias import Bias
from reports.truth.calibration import Calibration
from reports.truth.effort import Effort
from reports.truth.finding import Finding
from reports.truth.footprint_colours import ColourLoss
from reports.truth.path_traced import Traced
from reports.truth.sampling import SETTINGS, Saving

COMPONENT_TITLES: Final = ("S warp", "S weft", "C warp", "C weft")


def stability_rows(findings: Sequence[Finding]) -> dict[str, list[dict[str, Any]]]:
    """Return the rows of the table of extremes by arithmetic: worst error, limit, the textbook's, what cannot be."""
    result: dict[str, list[dict[str, Any]]] = {}
    for finding in findings:
        share = finding.naive_not_finite / finding.count
        lost = f"{100 * share:.0f} % NaN" if share else ""
        naive = "" if missing(finding.naive) or share == 1 else f"{finding.naive:.1e}"
        result.setdefault(finding.arithmetic, []).append(
            {
                "expression": finding.expression,
                "corner": finding.corner,
                "cells": [
                    f"{finding.worst:.1e}",
                    f"{finding.limit:.1e}",
                    ", ".join(filter(None, (naive, lost))) or NONE,
                    str(finding.not_finite),
                    str(finding.negative),
                ],
                "holds": finding.holds,
                "result": "ok" if finding.holds else "limit",
                "at": finding.at,
            }
        )
    return result


def rate_rows(records: Sequence[Record]) -> list[list[str]]:
    """Return the rows of the table of speeds: what, fabric, value with unit, note."""
    return [
        [record.setting, record.fabric or NONE, f"{record.value:,.3g} {record.unit}", record.note]
        for record in records
        if record.metric == "rate"
    ]


ACCURACY: Final = ("RMSE", "error", "stated", "points", "queries a second", "× fewer than mc")
"""Columns of `accuracy_rows` after the setting."""


def accuracy_rows(found: Sequence[Accuracy]) -> dict[str, list[list[str]]]:
    """Return the rows of the tables of accuracy by fabric: setting, then `ACCURACY`."""
    result: dict[str, list[list[str]]] = {}
    for row in found:
        numbers = [percent(row.rmse, 2), percent(row.true_error, 2), percent(row.stated_error, 2)]
        numbers += [f"{row.points:,.0f}", f"{row.rate:,.0f}", times(row.saved)]
        result.setdefault(row.fabric, []).append([row.setting, *numbers])
    return result


CALIBRATION: Final = ("cloth", "components", "transparency")
"""Columns of `calibration_rows` after the estimator."""


def calibration_rows(found: Sequence[Calibration]) -> list[list[str]]:
    """Return the rows of the table of calibration: estimator, then `CALIBRATION`."""

    def between(row: Calibration) -> str:
        return "" if row.low is None or row.high is None else f" ({row.low:.2f} to {row.high:.2f})"

    return [
        [
            plain(row.estimator),
            row.kind,
            f"{row.ratio:.2f}{between(row)} · {percent(row.exceeded, 2)}",
            f"{row.ratio_through:.2f} · {percent(row.exceeded_through, 2)}",
        ]
        for row in sorted(found, key=lambda row: row.estimator)
    ]


COLOURS: Final = ("footprint", "loss", "bias", "time of mean colours", "of exact colours")
"""Columns of `colour_rows` after the fabric."""


def colour_rows(found: Sequence[ColourLoss]) -> list[list[str]]:
    """Return the rows of the table of colours: fabric, then `COLOURS`."""
    return [
        [
            plain(row.fabric),
            f"{row.size} yarns",
            percent(row.loss),
            f"{100 * row.bias:+.2f} %".replace("-", "−"),
            f"{1e6 * row.seconds:.2g} µs",
            f"{1e3 * row.exact_seconds:.2g} ms",
        ]
        for row in found
    ]


BIAS: Final = ("light", *COMPONENT_TITLES)
"""Columns of `bias_rows` after the fabric."""


def bias_rows(found: Sequence[Bias]) -> list[list[str]]:
    """Return the rows of the table of bias: fabric, then `BIAS`; a cell ends in ✓ if it is small, in ✗ if it is not."""
    marks = {"below": " ✓", "above": " ✗", "open": ""}
    lines: dict[tuple[str, str], dict[str, str]] = {}
    for bias in found:
        value = round(100 * bias.value, 2) + 0.0  # no zero is negative
        text = f"{value:+.2f} ± {100 * bias.standard_error:.2f} %{marks[bias.result]}".replace("-", "−")
        lines.setdefault((bias.fabric, bias.side), {})[bias.component] = text
    return [
        [plain(fabric), side.removeprefix("light "), *(cells.get(name, NONE) for name in COMPONENTS)]
        for (fabric, side), cells in lines.items()
    ]


SAMPLERS: Final = SETTINGS[1:]
"""Columns of `sampler_rows` after the fabric."""


def sampler_rows(found: Sequence[Saving]) -> list[list[str]]:
    """Return how many times less variance each sampler has than the cosine, also in equal time, and its time."""
    lines: dict[str, dict[str, str]] = {}
    for one in found:
        lines.setdefault(one.fabric, {})[one.sampler] = (
            f"{times(one.variance_saved)} · {times(one.saved_in_time)} · {one.sample_time:,.0f} ns"
        )
    return [[plain(fabric), *(cells.get(name, NONE) for name in SAMPLERS)] for fabric, cells in lines.items()]


TRACED: Final = ("method", "samples", "error", "seconds", "× lower in equal time")
"""Columns of `traced_rows` after the scene."""


def traced_rows(found: Sequence[Traced]) -> list[list[str]]:
    """Return the rows of the table of path-traced frames: scene, then `TRACED`."""
    return [
        [
            plain(one.fabric),
            one.method,
            one.samples,
            f"{one.error:.1e}",
            f"{one.seconds:.2f}",
            NONE if missing(one.gain) else times(one.gain),
        ]
        for one in found
    ]


EFFORT: Final = ("how", "queries", "points", "µs a query", "time")
"""Columns of `effort_rows` after the fabric."""


def effort_rows(found: Sequence[Effort]) -> list[list[str]]:
    """Return the rows of the table of where the time goes: fabric, then `EFFORT`; shares are of the fabric's."""
    whole: dict[str, float] = {}
    for row in found:
        whole[row.fabric] = whole.get(row.fabric, 0.0) + row.share * row.seconds
    return [
        [
            plain(row.fabric),
            row.kind,
            percent(row.share),
            f"{row.points:,.0f}",
            f"{1e6 * row.seconds:,.0f}",
            percent(row.share * row.seconds / whole[row.fabric], 0) if whole[row.fabric] else NONE,
        ]
        for row in found
    ]
