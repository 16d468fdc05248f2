"""All tables of results of a page, by section: their columns are specified here, their words in `tables.toml`.

Columns of metrics are those of the catalogue: an entry there with the name of a table is a column of that table.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, fields, replace
from typing import Any, Final

import numpy as np
import pandas as pd

from reports.catalogue import METRICS, OTHER, columns_of, metric_row
from reports.measure.extremes import FOOTPRINTS, error_name, extremes_table
from reports.measure.memory import UNSURE
from reports.measure.silhouette import silhouette_table
from reports.over_seeds import MOST
from reports.record import Record, to_table
from reports.tables import summary
from reports.tables.equal_time import equal_time_table, size_table
from reports.tables.number_format import (
    FORMATS,
    NONE,
    beyond_noise,
    display,
    fixed,
    grouped,
    listed,
    missing,
    percent,
    plain,
    scientific,
    shown,
    significant,
    size,
    span,
    times,
)
from reports.tables.summary import BASELINE, ERRORS, fabric_ranges, over_unseen, rows, unranged
from reports.tables.table import (
    Column,
    ResultTable,
    TableCell,
    TableRow,
    by_method,
    cells,
    method_row,
    number,
    of_methods,
    of_rows,
    table,
)
from reports.tables.tradeoff import tradeoff_table
from reports.truth import (
    accuracy,
    bias,
    calibration,
    effort,
    finding,
    footprint_colours,
    path_traced,
    sampling,
)
from reports.truth.row_records import RowRecords

Frames = Mapping[str, pd.DataFrame]

_Values = Mapping[str, object]


def page_frames(records: Sequence[Record]) -> dict[str, pd.DataFrame]:
    """Return the condensed frames of a page by name; frames without rows only where the page always shows them."""
    frames = {
        "records": to_table(records),
        "errors": summary.error_table(records),
        "errors_by_fabric": summary.fabric_table(records),
        "pictures": summary.picture_table(records),
        "aliasing": summary.aliasing_table(records),
        "timing": summary.timing_table(records),
        "energy": summary.energy_table(records),
        "silhouettes": silhouette_table(records),
    }
    frames["tradeoff"] = tradeoff_table(frames["errors"], frames["timing"], frames["aliasing"])
    frames["scenes"] = summary.scene_table(records)
    frames["by_size"] = size_table(records)
    frames["equal_time"] = equal_time_table(frames["by_size"])
    where_measured = {"between": summary.path_table(records), OTHER: summary.other_table(records)}
    where_measured["extremes"] = extremes_table(records)
    for name, kept in _KEPT.items():
        where_measured[name] = pd.DataFrame([asdict(row) for row in kept.from_records(records)])
    return frames | {name: frame for name, frame in where_measured.items() if len(frame)}


def ranged_frames(frames: Frames) -> dict[str, pd.DataFrame]:
    """Return the frames of a page without the numbers that another training would change, and that have no range.

    These are numbers of networks that were trained once, on a single unseen fabric (`summary.unranged`).
    """
    left_out = unranged(frames["errors"])

    def without(frame: pd.DataFrame) -> pd.DataFrame:
        if frame.empty or not left_out:
            return frame
        return frame[
            [key not in left_out for key in zip(frame["role"], frame["method"], frame["setting"], strict=True)]
        ]

    errors, aliasing, by_fabric = without(frames["errors"]), without(frames["aliasing"]), frames["errors_by_fabric"]
    for role, method, setting in left_out:
        by_fabric = by_fabric.copy()
        by_fabric.loc[by_fabric["role"] == role, f"{method} {setting}".strip()] = math.nan
    changed = {"errors": errors, "aliasing": aliasing, "errors_by_fabric": by_fabric}
    return {**frames, **changed, "tradeoff": tradeoff_table(errors, frames["timing"], aliasing)}


def result_tables(
    records: Sequence[Record], frames: Frames, values: _Values, per_material: Collection[str] = ()
) -> dict[str, list[ResultTable]]:
    """Return the tables of every section that has any.

    Parameters
    ----------
    frames : mapping
        From `page_frames` or `ranged_frames`.
    values : mapping
        Values of words: `reports.tables.sentences.facts`, and options of a page.
    per_material : collection of str
        Methods that are trained on every fabric by itself.
    """
    sections = {
        "trade": _fronts(frames["tradeoff"], values),
        "error": _errors(records, frames, values, per_material),
        "equal-time": _equal_time(frames["equal_time"], values),
        "scenes": _scenes(frames["scenes"], values),
        "aliasing": [
            of_methods("aliasing", part, list(map(number, columns_of("aliasing"))), {**values, "role": role}, role)
            for role, part in _by(frames["aliasing"], "role")
        ],
        "energy": _energy(frames, values),
        "latents": _latents(records, frames, values),
        "silhouettes": [of_methods("silhouettes", frames["silhouettes"], _SILHOUETTES, values)],
        "time": [_timing(frames["timing"], values)],
        "other": _other(frames, values),
        "stability": _extremes(frames, values),
    }
    for section, tables in truth_tables(records, values).items():
        sections[section] = [*sections.get(section, []), *tables]
    return {name: full for name, tables in sections.items() if (full := _without_repeats(tables))}


def _without_repeats(tables: Iterable[ResultTable]) -> list[ResultTable]:
    """Return the tables that have rows; of equal words of neighbours the first intro and the last note stay."""
    full = [part for part in tables if part.rows]
    kept = []
    for index, part in enumerate(full):
        before = full[index - 1].intro if index else ()
        after = full[index + 1].note if index + 1 < len(full) else ()
        intro = tuple(text for text in part.intro if text not in before)
        kept.append(replace(part, intro=intro, note=tuple(text for text in part.note if text not in after)))
    return kept


def _by(frame: pd.DataFrame, column: str) -> list[tuple[str, pd.DataFrame]]:
    """Return the parts of a frame by the values of a column, in their order."""
    return [(str(name), part) for name, part in frame.groupby(column, sort=False)] if len(frame) else []


def _ratio(name: str) -> Column:
    """Return the column of × lower; the baseline's is 1."""
    column = number(name, "× lower", times)
    return Column(column.title, lambda row: "1" if (row.method, row.setting) == BASELINE else column.cell(row))


def _fronts(tradeoff: pd.DataFrame, values: _Values) -> list[ResultTable]:
    """Return what is on the front by role, the fastest first."""
    columns = [
        number("ns", "ns a query", grouped),
        number("error", "error of the colour", lambda value: percent(value, 2)),
        number("bytes_stored"),
    ]
    tables = []
    for role, part in _by(tradeoff, "role"):
        front = part[part["front"]].sort_values("ns", kind="stable")
        beaten = [display(name) for name in dict.fromkeys(part["method"]) if name not in set(front["method"])]
        known = {**values, "role": role} | ({"beaten": listed(beaten)} if beaten else {})
        lines = [method_row(row.method, row.setting, cells(row, columns)) for row in rows(front)]
        tables.append(table("front", ["method", *(column.title for column in columns)], lines, known, role))
    return tables


def _errors(
    records: Sequence[Record], frames: Frames, values: _Values, per_material: Collection[str]
) -> list[ResultTable]:
    """Return errors on held-out queries by role, over unseen fabrics, and by fabric."""
    columns = [number("mse", ends=("low", "high")), number("noise_share", "noise", percent), _ratio("ratio")]
    columns += [number(name) for name in columns_of("errors") if name != "mse"]
    errors, tables = frames["errors"], []
    for role, part in _by(errors, "role"):
        count, queries = part["fabrics"].max(), f"{part['queries'].max():,}"
        known = {**values, "role": role, "fabrics": "one fabric" if count == 1 else f"{count} fabrics"}
        stars = [name for name in per_material if role == "unseen" and name in set(part["method"])]
        known |= {"queries": queries} | ({"starred": listed(list(map(display, stars)))} if stars else {})
        made = of_methods("errors", part, columns, known, role)
        lines = tuple(replace(line, label=line.label + " *" * (line.method in stars)) for line in made.rows)
        tables.append(replace(made, rows=lines))
    over = errors[[over_unseen(row) for row in rows(errors)]] if len(errors) else errors
    columns = [_ratio("ratio_fabrics"), *(_over_fabrics(name) for name in ERRORS)]
    tables.append(of_methods("over_fabrics", over, columns, values))
    least, most = fabric_ranges(records)
    for role, part in _by(frames["errors_by_fabric"], "role"):
        tables.append(_by_fabric(part, least.loc[part.index], most.loc[part.index], values, role))
    return tables


def _over_fabrics(name: str) -> Column:
    """Return the column of a geometric mean over fabrics."""
    metric = number(name)
    return Column(metric.title, number(f"{name}_fabrics", metric.title, lambda value: shown(name, value)).cell)


def _by_fabric(
    errors: pd.DataFrame, least: pd.DataFrame, most: pd.DataFrame, values: _Values, role: str
) -> ResultTable:
    """Return the MSE of every method on every fabric, a column a fabric; the lowest of a column is strong."""
    labels = [name for name in errors.columns if name not in ("role", "fabric") and errors[name].notna().any()]
    lowest = errors[labels].min(axis=1)
    lines = []
    for label in labels:
        method, _, setting = label.partition(" ")
        line = []
        for value, best, low, high in zip(errors[label], lowest, least[label], most[label], strict=True):
            trainings_of = span(scientific, low, high) if low < high and not missing(value) else ""
            line.append(TableCell(scientific(value), range=trainings_of, strong=value == best))
        lines.append(method_row(method, setting, line))
    head = ["method", *(plain(str(name)) for name in errors["fabric"])]
    return table("by_fabric", head, by_method(lines), {**values, "role": role}, role)


def _equal_time(frame: pd.DataFrame, values: _Values) -> list[ResultTable]:
    """Return for each measure but the diffuse one the errors of methods, and those of rivals in the same time."""
    tables = []
    for measure, part in _by(frame, "measure"):
        if measure == "diffuse":
            continue
        sizes, lines = list(dict.fromkeys(part["size"])), []
        for key, group in part.groupby(["method", "setting", "rival"], sort=False):
            method, setting, rival = map(str, key)
            at = {row.size: row for row in rows(group)}
            line = [TableCell(display(rival))]
            for row in map(at.__getitem__, sizes):
                other = "too slow" if missing(row.rival_error) else times(row.ratio)
                line.append(TableCell(f"{percent(row.error)} · {other}", strong=row.ratio < 1.0))
            lines.append(method_row(method, setting, line))
        known = {**values, "measure": measure.capitalize()}
        tables.append(table("equal_time", ["method", "rival", *sizes], lines, known, measure))
    return tables


def _scenes(frame: pd.DataFrame, values: _Values) -> list[ResultTable]:
    """Return the table of every scene; its last row is what the noise of the truth alone scores."""

    def beyond(worded: Callable[[float], str]) -> Callable[[float], str]:
        return lambda value: beyond_noise(value, worded)

    columns = {"colour_rrmse": number("colour_rrmse", worded=beyond(percent))}
    columns["mse"] = number("mse", worded=beyond(scientific))
    columns |= {"ratio": number("ratio", "× lower", times)}
    columns |= {name: number(name) for name in (*columns_of("aliasing"), *columns_of("scenes"))}
    if "fovvideovdp" in columns and ("fovvideovdp" not in frame or frame["fovvideovdp"].isna().all()):
        del columns["fovvideovdp"]
    time = columns["frame_time"]
    strong = Column(time.title, lambda row: replace(TableCell(str(time.cell(row))), strong=bool(row.front)))
    columns["frame_time"] = strong
    tables = []
    for scene, part in _by(frame, "scene"):
        floors = {"mse": "truth_noise"} | {name: f"{name}_floor" for name in columns if f"{name}_floor" in METRICS}
        noise = [TableCell(shown(name, part[floors[name]].mean()) if name in floors else NONE) for name in columns]
        made = of_methods("scene", part, list(columns.values()), {**values, "scene": plain(scene)}, scene)
        tables.append(replace(made, rows=(*made.rows, TableRow("noise of the truth", tuple(noise), kind="noise"))))
    return tables


def _energy(frames: Frames, values: _Values) -> list[ResultTable]:
    """Return the largest albedos, with errors and times; those above 1 are marked."""

    def albedo(name: str) -> Column:
        column = number(name, metric_row(f"furnace_{name}").title, lambda value: f"{value:.3f}")

        def cell(row: Any) -> TableCell:
            made = column.cell(row)
            assert isinstance(made, TableCell)
            largest = max(getattr(row, name), np.nan_to_num(getattr(row, name + MOST)))
            return replace(made, text=made.text + (" ✗" if largest > 1.0 else ""))

        return Column(column.title, cell)

    frame = frames["energy"]
    for name, column, source in (("errors", "mse", frames["errors"]), ("timing", "median_ns", frames["timing"])):
        part = source[source["role"] == "seen"] if name == "errors" and len(source) else source
        part = part if len(part) else pd.DataFrame(columns=["method", "setting", column])
        frame = frame.merge(part[["method", "setting", column]], on=["method", "setting"], how="left")
    columns = [*map(albedo, ("diffuse", "specular", "colour")), number("mse", "MSE, seen", ends=("", ""))]
    return [of_methods("energy", frame, [*columns, number("median_ns", "ns a query", grouped)], values)]


def _latents(records: Sequence[Record], frames: Frames, values: _Values) -> list[ResultTable]:
    """Return errors along paths between fabrics, and times of edits."""
    tables = []
    if "between" in frames:
        frame, lines = frames["between"], []
        for key, part in frame.groupby(["method", "setting", "fabric", "to", "how"], sort=False):
            method, setting, fabric, to, how = map(str, key)
            path = TableCell(f"{plain(fabric)} → {plain(to)}")
            lines.append(method_row(method, setting, [path, TableCell(how), *map(_percent_cell, part["error"])]))
        shares = [f"t = {share:g}" for share in dict.fromkeys(frame["share"])]
        tables.append(table("between", ["method", "from → to", "way", *shares], lines, values))
    edits = [
        method_row(
            record.method,
            record.setting,
            (
                TableCell(record.note),
                TableCell(f"{record.value:.3g} {record.unit}"),
                TableCell(NONE if record.low is None else f"{record.low:.3g} … {record.high:.3g}"),
            ),
        )
        for record in records
        if record.metric == "encode_time"
    ]
    return [*tables, table("edits", ["method", "edit", "median", "quartiles"], edits, values)]


def _percent_cell(value: float) -> TableCell:
    return TableCell(percent(value))


def _outwards(value: float) -> str:
    return f"{value:+.4f}".replace("-", "−")


_SILHOUETTES: Final = (
    number("coverage", METRICS["silhouette_coverage"].title, fixed),
    number("displacement", METRICS["silhouette_displacement"].title, _outwards),
    number("light", METRICS["silhouette_light"].title, fixed),
    number("fabrics", "fabrics", grouped),
)


def _timing(frame: pd.DataFrame, values: _Values) -> ResultTable:
    """Return times on the fewest and the most threads, and what is stored."""
    few, many = (frame[name].max() if len(frame) else math.nan for name in ("threads", "most_threads"))
    fewer = f", {few:.0f} threads" if few > 1 else ""
    more = f", {many:.0f} threads" if many > 1 else ", more threads"

    def memory(value: float) -> str:
        return f"below {size(UNSURE)}" if value < UNSURE else size(value)

    columns = [
        number("median_ns", f"ns a query{fewer}", grouped, ("first_quartile_ns", "third_quartile_ns")),
        number("time_ratio", "× time", times),
        number("frame_ms", f"ms a frame{fewer}", significant),
        number("most_threads_ns", f"ns a query{more}", significant),
        number("most_threads_frame_ms", f"ms a frame{more}", significant),
        number("prepare_ms", METRICS["prepare_time"].title, significant),
        number(
            "memory",
            METRICS["peak_memory"].title,
            memory,
        ),
        number("bytes_stored"),
    ]
    return of_methods("timing", frame, columns, values)


def _other(frames: Frames, values: _Values) -> list[ResultTable]:
    """Return the metrics without a table of their own, each with its unit and which direction is better."""
    if OTHER not in frames:
        return []

    def column(name: str) -> Column:
        row = metric_row(name)
        title = row.title + (f", {row.unit}" if row.unit != "1" else "")
        better = f" ({row.better} is better)" if row.better else ""
        return number(name, title + better, lambda value: shown(name, value))

    names = [name for name in frames[OTHER].columns[2:] if f"{name}{MOST}" in frames[OTHER]]
    return [of_methods(OTHER, frames[OTHER], list(map(column, names)), values)]


def _extremes(frames: Frames, values: _Values) -> list[ResultTable]:
    """Return methods at their extremes; impossible answers are marked."""

    def share(value: float) -> str:
        return NONE if missing(value) else "0" if value == 0 else f"{value:.1e}"

    def wrong(name: str, title: str) -> Column:
        return Column(title, lambda row: f"{count} of {row.answers} ✗" if (count := getattr(row, name)) else "0")

    columns = [number(error_name(footprint), f"σ {footprint:g}", percent) for footprint in FOOTPRINTS]
    columns += [number("grazing", "89.9°", percent), number("lustrous", "α = .01", percent)]
    columns += [
        number("rounding", "from fp32", share),
        number("far", "far", share),
        number("large", "1e4 − 1e2", share),
    ]
    columns += [wrong("not_finite", "NaN, ∞"), wrong("negative", "below 0")]
    return [of_methods("extremes", frames["extremes"], columns, values)] if "extremes" in frames else []


def truth_tables(records: Sequence[Record], values: _Values) -> dict[str, list[ResultTable]]:
    """Return the tables of the ground truth itself, of its sampler and of path-traced frames, by section."""
    efforts = effort.RECORDS.from_records(records)
    whole: dict[str, float] = {}
    for row in efforts:
        whole[row.fabric] = whole.get(row.fabric, 0.0) + row.share * row.seconds
    of_time = Column("share of the time", lambda row: percent(row.share * row.seconds / whole[row.fabric], 0))
    rates = [record for record in records if record.metric == "rate"]
    more = {
        "stability": Column("result", lambda row: row.fault or "ok"),
        "truth_bias": Column("standard error", lambda row: percent(row.standard_error, 2) + _MARKS[row.result]),
        "truth_effort": of_time,
    }
    tables = {"rates": [of_rows("rates", rates, _RATES, values)]}
    for name, kept in _KEPT.items():
        section = "accuracy" if name.startswith("truth_") else name
        tables.setdefault(section, []).append(measured(name, kept, kept.from_records(records), values, more.get(name)))
    return {section: full for section, parts in tables.items() if (full := [part for part in parts if part.rows])}


def _text_of(name: str) -> Callable[[Any], str]:
    return lambda row: str(getattr(row, name)) if name == "expression" else plain(getattr(row, name))


def truth_facts(records: Sequence[Record]) -> dict[str, object]:
    """Return the values of words (`tables.toml`) about the truth: limits, and how much was measured."""
    accuracies, calibrations = (part.RECORDS.from_records(records) for part in (accuracy, calibration))
    values: dict[str, object] = {"exceeded": percent(calibration.EXCEEDED), "limit": percent(bias.LIMIT)}
    values["target"] = percent(effort.RELATIVE_ERROR)
    if accuracies:
        values["reference"] = percent(max(row.reference for row in accuracies), 2)
        values["accuracy_count"] = max(row.count for row in accuracies)
    if calibrations:
        values["calibration_rows"] = max(row.count for row in calibrations)
        values["calibration_count"] = sum(row.count for row in calibrations)
    return values


def measured(
    name: str, kept: RowRecords[Any], objects: Iterable[Any], values: _Values, last: Column | None = None
) -> ResultTable:
    """Return the table of rows that are kept as Records: what names a row, then its metrics as the catalogue says."""
    named = [*(["fabric"] if any(part.name == "fabric" for part in fields(kept.row)) else [])]
    named += [kept.method_field] * bool(kept.method_field) + list(kept.setting)
    columns = [Column(name, _text_of(name)) for name in named]
    for index, (field, metric) in enumerate(kept.metrics.items()):
        about = METRICS[metric]
        ends = ("", "") if index else ("low", "high")
        columns.append(number(field, about.title, FORMATS[about.format], ends))
    return of_rows(name, objects, [*columns, *([last] if last else [])], values)


_MARKS: Final = {"below": " ✓", "above": " ✗", "open": ""}

_KEPT: Final[Mapping[str, RowRecords[Any]]] = {
    "stability": finding.RECORDS,
    "truth_accuracy": accuracy.RECORDS,
    "truth_calibration": calibration.RECORDS,
    "truth_bias": bias.RECORDS,
    "truth_effort": effort.RECORDS,
    "truth_colours": footprint_colours.RECORDS,
    "sampler": sampling.RECORDS,
    "traced": path_traced.RECORDS,
}
"""Measurements of the truth itself, of its sampler and of path tracing, by the names of their tables."""

_RATES: Final = (
    Column("measurement", lambda row: row.setting),
    Column("fabric", lambda row: row.fabric or NONE),
    Column("rate", lambda row: f"{row.value:,.3g} {row.unit}"),
    Column("note", lambda row: row.note),
)
