"""Rows of the tables of methods, as text."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from typing import Any, Final

import numpy as np
import pandas as pd

from pipeline.truth.conventions import COMPONENTS
from reports.catalogue import MetricRow, metric_row
from reports.measure.extremes import FOOTPRINTS, error_name
from reports.measure.memory import UNSURE
from reports.over_fabrics import ERRORS, over_unseen
from reports.over_seeds import LEAST, MOST, is_range
from reports.record import TRUTH, Metric, Record
from reports.tables.headline import learnt
from reports.tables.number_format import (
    NO_BREAK,
    NONE,
    display,
    fixed,
    grouped,
    interval,
    interval_of,
    missing,
    percent,
    plain,
    scientific,
    shown,
    significant,
    size,
    span,
    span_of,
    times,
)
from reports.tables.summary import BASELINE, rows

Row = dict[str, Any]


def groups(lines: Sequence[Row]) -> list[Row]:
    """Return a group for each method: its name and its rows; a method with several settings has a head (`head`)."""
    found: dict[str, list[Row]] = {}
    for line in lines:
        found.setdefault(line["method"], []).append(line)
    return [
        {"method": method, "label": display(method), "head": len(rows_) > 1, "rows": rows_}
        for method, rows_ in found.items()
    ]


def row_of(method: str, setting: str) -> Row:
    """Return the start of a method's row: its name whole (`label`) and within its group (`setting`)."""
    return {
        "method": method,
        "label": display(method, setting),
        "setting": setting.replace(" ", NO_BREAK) or display(method),
        "baseline": (method, setting) == BASELINE,
    }


def ranged(text: str, row: Any, column: str, worded: Callable[[float], str]) -> str | Row:
    """Return a number as a cell of a table, with its range over trainings where there are several."""
    found = span(worded, getattr(row, column + LEAST), getattr(row, column + MOST))
    return {"text": text, "range": found} if found else text


def _metric(metric: str, row: Any) -> str | Row:
    """Return the value of a metric as a cell, with its range over trainings where there are several."""
    found = span_of(metric, getattr(row, metric + LEAST), getattr(row, metric + MOST))
    text = shown(metric, getattr(row, metric))
    return {"text": text, "range": found} if found else text


def plain_text(cell: str | Row) -> str:
    """Return a cell as text, with its interval and its range."""
    if isinstance(cell, str):
        return cell
    return " ".join(filter(None, (cell["text"], cell.get("interval", ""), cell.get("range", ""))))


ERROR_METRICS: Final[tuple[Metric, ...]] = (
    "colour_rrmse",
    "colour_rrmse_99",
    *(f"rrmse_{name}" for name in COMPONENTS),
)
"""Relative errors of the error table."""

ERROR: Final = (
    "MSE",
    "95 % interval",
    "noise",
    f"×{NO_BREAK}lower",
    f"interval of ×{NO_BREAK}lower",
    "colour",
    f"colour, 99{NO_BREAK}%",
    *(f"{part}{NO_BREAK}{yarn}" for part in "SC" for yarn in ("warp", "weft")),
)
"""Columns of `error_rows` after the method."""


def error_rows(errors: pd.DataFrame, per_material: Sequence[str]) -> dict[str, list[Row]]:
    """Return the rows of the error table by role, in groups."""
    result: dict[str, list[Row]] = {}
    for row in rows(errors):
        known = row.role == "unseen" and row.method in per_material
        line = row_of(row.method, row.setting) | {
            "cells": [
                _metric("mse", row),
                f"{scientific(row.low)} … {scientific(row.high)}",
                percent(row.noise_share),
                ranged(times(row.ratio), row, "ratio", times) if (row.method, row.setting) != BASELINE else "1",
                interval(row.ratio_low, row.ratio_high) if (row.method, row.setting) != BASELINE else NONE,
                *(_metric(metric, row) for metric in ERROR_METRICS),
            ],
        }
        line["label"] += " *" if known else ""
        result.setdefault(row.role, []).append(line)
    return {role: groups(lines) for role, lines in result.items()}


OVER_FABRICS: Final = (f"×{NO_BREAK}lower", "MSE", "colour", *ERROR[-4:])
"""Columns of `over_fabrics_rows` after the method."""


def over_fabrics_rows(errors: pd.DataFrame) -> list[Row]:
    """Return geometric means over several unseen fabrics with their intervals over fabrics, in groups."""
    lines = []
    for row in rows(errors):
        if over_unseen(row):
            ends = f"({interval(row.ratio_fabrics_low, row.ratio_fabrics_high)})"
            trainings = span(times, row.ratio_fabrics_least, row.ratio_fabrics_most)
            ratio: str | Row = {"text": times(row.ratio_fabrics), "interval": ends, "range": trainings}
            if (row.method, row.setting) == BASELINE:
                ratio = "1"
            cells = [ratio, *(_over_fabrics(name, row) for name in ERRORS)]
            lines.append(row_of(row.method, row.setting) | {"cells": cells})
    return groups(lines)


def _over_fabrics(metric: str, row: Any) -> Row:
    """Return a mean over fabrics as a cell, with its interval over fabrics and its range over trainings."""
    mean, *ends = (getattr(row, f"{metric}_fabrics{end}") for end in ("", "_low", "_high"))
    trainings = span_of(metric, *(getattr(row, f"{metric}_fabrics{end}") for end in (LEAST, MOST)))
    return {"text": shown(metric, mean), "interval": interval_of(metric, *ends), "range": trainings}


def fabric_rows(table: pd.DataFrame, ranges: tuple[pd.DataFrame, pd.DataFrame]) -> dict[str, Row]:
    """Return by role the MSE of every method on every fabric, a column a fabric; the lowest of a column is marked.

    Parameters
    ----------
    table, ranges : DataFrame
        From `summary.fabric_table` and `summary.fabric_ranges`.
    """
    found = {}
    for role in dict.fromkeys(table["role"]):
        chosen = table["role"] == role
        found[str(role)] = _fabric_rows(table[chosen], [part[chosen.to_numpy()] for part in ranges])
    return found


def _fabric_rows(table: pd.DataFrame, ranges: Sequence[pd.DataFrame]) -> Row:
    labels = [column for column in table.columns if column not in ("role", "fabric") and table[column].notna().any()]
    records = table.to_dict("records")
    best = [min((r[label] for label in labels if not missing(r[label])), default=math.nan) for r in records]
    lines = []
    for label in labels:
        values = [(record[label], lowest) for record, lowest in zip(records, best, strict=True)]
        cells: list[Row] = [{"text": scientific(value), "best": value == lowest} for value, lowest in values]
        for cell, least, most in zip(cells, *(part[label] for part in ranges), strict=True):
            cell["range"] = span(scientific, least, most) if least < most else ""
        lines.append(row_of(*_split(label)) | {"cells": cells})
    return {"columns": [plain(str(record["fabric"])) for record in records], "groups": groups(lines)}


FRONT: Final = ("ns a query", "error of the colour", "bytes stored")
"""Columns of `front_rows` after the method."""


def front_rows(table: pd.DataFrame) -> dict[str, list[Row]]:
    """Return what is on the front by role, the fastest first."""
    result: dict[str, list[Row]] = {}
    for row in rows(table[table["front"]].sort_values("ns", kind="stable") if len(table) else table):
        error = ranged(percent(row.error, 2), row, "error", lambda value: percent(value, 2))
        cells = [f"{row.ns:,.0f}", error, size(row.bytes_stored)]
        line = row_of(row.method, row.setting) | {"cells": cells}
        result.setdefault(row.role, []).append(line)
    return result


def equal_time_rows(table: pd.DataFrame) -> dict[str, Row]:
    """Return for each measure the names of the sizes, and a row a method and rival: its error, and the rival's over it.

    A rival that has no setting as fast says so.
    """
    result: dict[str, Row] = {}
    for measure, group in table.groupby("measure", sort=False) if len(table) else ():
        sizes, lines = list(dict.fromkeys(group["size"])), []
        for (method, setting, rival), found in group.groupby(["method", "setting", "rival"], sort=False):
            by_size = {row.size: row for row in rows(found)}
            cells = []
            for row in (by_size[name] for name in sizes):
                other = times(row.ratio) if math.isfinite(row.rival_error) else "too slow"
                cells.append({"text": f"{percent(row.error)} · {other}", "beaten": row.ratio < 1.0})
            lines.append(row_of(str(method), str(setting)) | {"rival": display(str(rival)), "cells": cells})
        result[str(measure)] = {"sizes": sizes, "rows": lines}
    return result


def aliasing_rows(aliasing: pd.DataFrame, records: Sequence[Record]) -> dict[str, Any]:
    """Return the rows of the aliasing table in groups, and the variance that the motion itself brings."""
    motion = [record.value for record in records if record.metric == "motion"]
    roles = list(dict.fromkeys(aliasing["role"])) if len(aliasing) else []
    found: dict[tuple[str, str], dict[str, list[str | Row]]] = {}
    for row in rows(aliasing):
        cells = [_metric(metric, row) for metric in ("flicker", "excess_energy")]
        found.setdefault((row.method, row.setting), {})[row.role] = cells
    lines = [
        row_of(*key) | {"cells": [text for role in roles for text in by_role.get(role, [NONE, NONE])]}
        for key, by_role in found.items()
    ]
    return {
        "groups": groups(lines),
        "columns": [f"{name}, {role}" for role in roles for name in ("flicker", "excess energy")],
        "motion": shown("motion", float(np.mean(motion))) if motion else NONE,
    }


ENERGY: Final = ("diffuse, k_d = 1", "specular, k_s = 1", "in its own colours", "MSE, seen", "ns a query")
"""Columns of `energy_rows` after the method."""


def energy_rows(energy: pd.DataFrame, errors: pd.DataFrame, timing: pd.DataFrame) -> list[Row]:
    """Return the rows of the table of energies, in groups; albedos above 1 are marked."""
    lines = []
    for row in rows(energy):
        cells = [_albedo(row, name) for name in ("diffuse", "specular", "colour")]
        mse = _number(errors[errors["role"] == "seen"] if len(errors) else errors, row, "mse")
        lines.append(
            row_of(row.method, row.setting)
            | {"cells": [*cells, scientific(mse), grouped(_number(timing, row, "median_ns"))]}
        )
    return groups(lines)


def _albedo(row: Any, name: str) -> str | Row:
    """Return an albedo as a cell; marked if it, or that of any training, is above 1."""
    largest = max(getattr(row, name), np.nan_to_num(getattr(row, name + MOST)))
    return ranged(f"{getattr(row, name):.3f}{' ✗' if largest > 1.0 else ''}", row, name, lambda value: f"{value:.3f}")


def _number(table: pd.DataFrame, row: Any, column: str) -> float:
    """Return a column of the row of the same method and setting in another table; NaN if there is none."""
    if table.empty:
        return math.nan
    found = table[(table["method"] == row.method) & (table["setting"] == row.setting)][column]
    return float(found.iloc[0]) if len(found) else math.nan


SILHOUETTE: Final = ("coverage, RMSE", "edge too far out, yarn spacings", "light, RMSE", "fabrics")
"""Columns of `silhouette_rows` after the method."""


def silhouette_rows(table: pd.DataFrame) -> list[Row]:
    """Return the rows of the table of silhouettes, in groups."""
    lines = []
    for row in rows(table):
        cells = [
            ranged(fixed(row.coverage), row, "coverage", fixed),
            ranged(_outwards(row.displacement), row, "displacement", _outwards),
            ranged(fixed(row.light), row, "light", fixed),
            f"{row.fabrics}",
        ]
        lines.append(row_of(row.method, row.setting) | {"cells": cells})
    return groups(lines)


def _outwards(value: float) -> str:
    return f"{value:+.4f}".replace("-", "−")


def timing_columns(timing: pd.DataFrame) -> list[str]:
    """Return the columns of `timing_rows` after the method."""
    fewest, most = (timing[name].max() if len(timing) else math.nan for name in ("threads", "most_threads"))
    few = f", {fewest:.0f} threads" if fewest > 1 else ""
    many = f", {most:.0f} threads" if most > 1 else ", more threads"
    names = [f"ns a query{few}", "quartiles", "× time", f"ms a frame{few}", f"ns a query{many}", f"ms a frame{many}"]
    return [*names, "ms to add a fabric", "memory of a call", "bytes stored"]


def timing_rows(timing: pd.DataFrame) -> list[Row]:
    """Return the rows of the timing table, in groups."""
    return groups(
        [
            row_of(row.method, row.setting)
            | {
                "cells": [
                    f"{row.median_ns:,.0f}",
                    f"{row.first_quartile_ns:,.0f} … {row.third_quartile_ns:,.0f}",
                    times(row.time_ratio),
                    significant(row.frame_ms),
                    significant(row.most_threads_ns),
                    significant(row.most_threads_frame_ms),
                    shown("prepare_time", row.prepare_ms),
                    shown("peak_memory", row.memory) if not row.memory < UNSURE else "below " + size(UNSURE),
                    NONE if row.method == TRUTH else shown("bytes_stored", row.bytes_stored),
                ],
            }
            for row in rows(timing)
        ]
    )


def figures_of_merit(
    records: Sequence[Record],
    errors: pd.DataFrame,
    timing: pd.DataFrame,
    untrained: Collection[str] = (BASELINE[0],),
) -> list[Row]:
    """Return the few numbers at the head of the page, of the first learnt method and of the truth."""
    result = []
    methods = learnt(errors, untrained) if len(errors) else []
    if methods:
        method, setting = methods[0]
        for row in rows(errors[(errors["method"] == method) & (errors["setting"] == setting)]):
            if not missing(row.ratio):
                column = "ratio_fabrics" if over_unseen(row) else "ratio"
                fabrics = "fabric" if row.fabrics == 1 else "fabrics"
                note = f"MSE of 2 points over that of {display(method, setting)}, {row.fabrics} {row.role} {fabrics}"
                if over_unseen(row):
                    ends = interval(row.ratio_fabrics_low, row.ratio_fabrics_high)
                    note += f": geometric mean, 95 % interval over fabrics {ends}"
                note += f", {_trainings(row, column)}" if row.seeds else ""
                result.append({"value": times(getattr(row, column)), "note": note, "paper": "paper: 4.1×"})
        cost = timing[(timing["method"] == method) & (timing["setting"] == setting)]["time_ratio"]
        if len(cost) and not missing(cost.iloc[0]):
            note = f"time of a query of {display(method, setting)} over that of 2 points"
            result.append({"value": times(float(cost.iloc[0])), "note": note, "paper": "paper: 0.83×"})
    truth = [record.value for record in records if record.metric == "truth_relative_error"]
    if truth:
        note = "relative standard error of the truth: median over queries, mean over fabrics"
        result.append({"value": percent(float(np.mean(truth)), 2), "note": note, "paper": ""})
    return result


def _trainings(row: Any, column: str) -> str:
    """Return the number of trainings and the range of the ratio over them."""
    found = span(times, getattr(row, column + LEAST), getattr(row, column + MOST))
    return " ".join(filter(None, (f"mean of {row.seeds} trainings" if row.seeds > 1 else "one training", found)))


EXTREMES: Final = (
    *(f"σ {size:g}" for size in FOOTPRINTS),
    "89.9°",
    "α = .01",
    "from fp32",
    "far",
    "1e4 − 1e2",
    "NaN, ∞",
    "below 0",
)
"""Columns of `extreme_rows` after the method."""


def extreme_rows(table: pd.DataFrame) -> list[Row]:
    """Return the rows of the table of methods at their extremes, in groups; impossible answers are marked."""
    lines = []
    for row in rows(table):
        errors = [percent(getattr(row, name)) for name in map(error_name, FOOTPRINTS)]
        errors += [percent(row.grazing), percent(row.lustrous)]
        others = [NONE if missing(x) else "0" if x == 0 else f"{x:.1e}" for x in (row.rounding, row.far, row.large)]
        wrong = [f"{count} of {row.answers} ✗" if count else "0" for count in (row.not_finite, row.negative)]
        lines.append(row_of(row.method, row.setting) | {"cells": [*errors, *others, *wrong]})
    return groups(lines)


def path_rows(table: pd.DataFrame) -> list[list[str]]:
    """Return the rows of the table of paths between fabrics: method, path, way, then the error at every share."""
    lines: dict[tuple[str, ...], list[str]] = {}
    for row in rows(table):
        path = f"{plain(row.fabric)} → {plain(row.to)}"
        lines.setdefault((display(row.method, row.setting), path, row.how), []).append(percent(row.error))
    return [[*key, *errors] for key, errors in lines.items()]


def edit_rows(records: Sequence[Record]) -> list[list[str]]:
    """Return the rows of the table of edits: method, edit, median time, quartiles."""
    return [
        [
            display(record.method, record.setting),
            record.note,
            f"{record.value:.3g} {record.unit}",
            f"{record.low:.3g} … {record.high:.3g}" if record.low is not None and record.high is not None else NONE,
        ]
        for record in records
        if record.metric == "encode_time"
    ]


def other_columns(table: pd.DataFrame) -> list[str]:
    """Return the columns of `other_rows` after the method: title, unit, and which direction is better."""
    return [_heading(metric_row(name)) for name in _metrics(table)]


def other_rows(table: pd.DataFrame) -> list[Row]:
    """Return the rows of the metrics without a table of their own, in groups."""
    lines = [
        row_of(row.method, row.setting) | {"cells": [_metric(m, row) for m in _metrics(table)]} for row in rows(table)
    ]
    return groups(lines)


def _metrics(table: pd.DataFrame) -> list[str]:
    """Return the columns of metrics."""
    return [name for name in table.columns[2:] if not is_range(name)]


def _heading(metric: MetricRow) -> str:
    unit = "" if metric.unit == "1" else f", {metric.unit}"
    return f"{metric.title}{unit}" + (f" ({metric.better} is better)" if metric.better else "")


def _split(label: str) -> tuple[str, str]:
    method, _, setting = label.partition(" ")
    return method, setting
