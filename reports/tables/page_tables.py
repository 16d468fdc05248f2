"""Sections of a page: their words and tables. Words and most columns are in `tables.toml`, what is special is here.

Columns of metrics are those of the catalogue: an entry there with the name of a table is a column of that table.
"""

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, fields
from typing import Any, Final, NamedTuple

import numpy as np
import pandas as pd

from reports.catalogue import METRICS, OTHER, columns_of, metric_row
from reports.measure.extremes import FOOTPRINTS, error_name
from reports.over_seeds import MOST
from reports.record import Record, to_table
from reports.tables import summary
from reports.tables.equal_time import equal_time_table, size_table
from reports.tables.number_format import NONE, display, listed, missing, percent, plain, scientific, shown, span, times
from reports.tables.sentences import facts, section_sentences
from reports.tables.summary import BASELINE, ERRORS, fabric_table, over_unseen, parts_of, rows, unranged
from reports.tables.table import (
    WORDS,
    Column,
    ResultTable,
    TableCell,
    TableRow,
    Values,
    columns_for,
    method_row,
    number,
    of_methods,
    of_rows,
    paragraphs,
    table,
    text,
)
from reports.tables.tradeoff import tradeoff_table
from reports.truth import (
    accuracy,
    bias,
    calibration,
    effort,
    finding,
    footprint_colours,
    measured_cloth,
    path_traced,
    sampling,
)
from reports.truth.row_records import RowRecords

Frames = Mapping[str, pd.DataFrame]

_FRAMES: Final = {
    "records": to_table,
    "errors": summary.error_table,
    "errors_by_fabric": summary.fabric_table,
    "pictures": summary.picture_table,
    "aliasing": summary.aliasing_table,
    "timing": summary.timing_table,
    "energy": summary.energy_table,
    "silhouettes": summary.silhouette_table,
    "scenes": summary.scene_table,
    "by_size": size_table,
}
ENTRY_CLASSES: Final = (4_000, 16_000, 100_000)
"""Most multiply-adds of a query, and most bytes of a fabric, in each class of entries but the last, which is open."""

_STATED: Final = columns_of("entries")
_NOTES: Final = {"machine": "stated_time", "trained on": "stated_bytes", "code": "stated_tries"}
_WHERE_MEASURED: Final = {"between": summary.path_table, OTHER: summary.other_table, "extremes": summary.extremes_table}


class Section(NamedTuple):
    """A section of a page."""

    id: str
    title: str
    intro: list[str]
    plots: list[str]
    sentences: list[str]  # the sum of its tables in words
    tables: list[ResultTable]
    note: list[str]


def page_frames(records: Sequence[Record]) -> dict[str, pd.DataFrame]:
    """Return the condensed frames of a page by name; frames without rows only where the page always shows them."""
    frames = {name: condensed(records) for name, condensed in _FRAMES.items()}
    frames["tradeoff"] = tradeoff_table(frames["errors"], frames["timing"], frames["aliasing"])
    frames["equal_time"] = equal_time_table(frames["by_size"])
    more = {name: condensed(records) for name, condensed in _WHERE_MEASURED.items()}
    more |= {name: pd.DataFrame([asdict(row) for row in kept.from_records(records)]) for name, kept in _KEPT.items()}
    return frames | {name: frame for name, frame in more.items() if len(frame)}


def ranged_frames(frames: Frames) -> dict[str, pd.DataFrame]:
    """Return the frames of a page without the numbers that another training would change, and that have no range.

    These are numbers of networks that were trained once, on a single unseen fabric (`summary.unranged`).
    """
    left_out = unranged(frames["errors"])
    if not left_out:
        return {**frames}
    ranged = {**frames, "errors_by_fabric": frames["errors_by_fabric"].copy()}
    for name in ("errors", "aliasing"):
        keys = zip(*(frames[name].get(key, ()) for key in ("role", "method", "setting")), strict=True)
        ranged[name] = frames[name].loc[[key not in left_out for key in keys]]
    for role, method, setting in left_out:
        of_role = ranged["errors_by_fabric"]["role"] == role
        ranged["errors_by_fabric"].loc[of_role, f"{method} {setting}".strip()] = math.nan
    ranged["tradeoff"] = tradeoff_table(ranged["errors"], frames["timing"], ranged["aliasing"])
    return ranged


def sections(
    records: Sequence[Record], frames: Frames, options: Values | None = None, per_material: Collection[str] = ()
) -> dict[str, Section]:
    """Return all sections by name, in their order, with what there is to show.

    Of the frames of `page_frames` those of `ranged_frames` are shown; `options` are values of words that the options of
    a page tell, `per_material` methods that are trained on every fabric by itself.
    """
    values = {**facts(records, frames["errors"], per_material), **_truth_facts(records), **(options or {})}
    ranged = ranged_frames(frames)
    tables, sentences = result_tables(records, ranged, values, per_material), section_sentences(ranged)
    made = {}
    for name, words in WORDS["sections"].items():
        intro, note = (paragraphs(words.get(part, []), values) for part in ("intro", "note"))
        shown = sentences.get(name, []), tables.get(name, [])
        made[name] = Section(name, words["title"], intro, words.get("plots", []), *shown, note)
    return made


def result_tables(
    records: Sequence[Record], frames: Frames, values: Values, per_material: Collection[str] = ()
) -> dict[str, list[ResultTable]]:
    """Return the tables of every section that has any; arguments as in `sections`, frames as they are shown."""
    made = {
        "trade": _fronts(frames["tradeoff"], values),
        "error": _errors(records, frames, values, per_material),
        "equal-time": _equal_time(frames["equal_time"], values),
        "scenes": _scenes(frames["scenes"], values),
        "aliasing": [
            of_methods("aliasing", part, {**values, "role": role}, key=role)
            for role, part in parts_of(frames["aliasing"], "role")
        ],
        "energy": _energy(frames, values),
        "latents": _latents(records, frames, values),
        "silhouettes": [of_methods("silhouettes", frames["silhouettes"], values)],
        "time": [_timing(frames["timing"], values)],
        "entries": [_entries(records, values)],
        "other": _other(frames, values),
        "stability": _extremes(frames, values),
    }
    for section, tables in _truth_tables(records, values).items():
        made[section] = [*made.get(section, []), *tables]
    return {name: full for name, tables in made.items() if (full := _without_repeats(tables))}


def _without_repeats(tables: Iterable[ResultTable]) -> list[ResultTable]:
    """Return the tables that have rows; of equal words of neighbours the first intro and the last note stay."""
    full = [part for part in tables if part.rows]
    kept = []
    for index, part in enumerate(full):
        before = full[index - 1].intro if index else ()
        after = full[index + 1].note if index + 1 < len(full) else ()
        intro = tuple(text for text in part.intro if text not in before)
        kept.append(part._replace(intro=intro, note=tuple(text for text in part.note if text not in after)))
    return kept


def _ratio(column: Column) -> Column:
    """Return the column of × lower; the baseline's is 1."""
    unity = TableCell("1")
    return Column(column.title, lambda row: unity if (row.method, row.setting) == BASELINE else column.cell(row))


def _fronts(tradeoff: pd.DataFrame, values: Values) -> list[ResultTable]:
    columns, tables = columns_for("front", values).values(), []
    for role, part in parts_of(tradeoff, "role"):
        front = part[part["front"]].sort_values("ns", kind="stable")
        beaten = [display(name) for name in dict.fromkeys(part["method"]) if name not in set(front["method"])]
        known = {**values, "role": role} | ({"beaten": listed(beaten)} if beaten else {})
        lines = [method_row(row.method, row.setting, [column.cell(row) for column in columns]) for row in rows(front)]
        tables.append(table("front", ["method", *(column.title for column in columns)], lines, known, role))
    return tables


def _errors(
    records: Sequence[Record], frames: Frames, values: Values, per_material: Collection[str]
) -> list[ResultTable]:
    errors, tables = frames["errors"], []
    columns = columns_for("errors", values, errors.columns)
    columns["ratio"] = _ratio(columns["ratio"])
    for role, part in parts_of(errors, "role"):
        count, queries = part["fabrics"].max(), f"{part['queries'].max():,}"
        known = {**values, "role": role, "fabrics": "one fabric" if count == 1 else f"{count} fabrics"}
        stars = [name for name in per_material if role == "unseen" and name in set(part["method"])]
        known |= {"queries": queries} | ({"starred": listed(list(map(display, stars)))} if stars else {})
        made = of_methods("errors", part, known, columns, role)
        lines = tuple(line._replace(label=line.label + " *" * (line.method in stars)) for line in made.rows)
        tables.append(made._replace(rows=lines))
    over = errors[[over_unseen(row) for row in rows(errors)]] if len(errors) else errors
    columns = {"ratio": _ratio(number("ratio_fabrics", "× lower", "times"))}
    columns |= {name: number(f"{name}_fabrics", metric=name) for name in ERRORS}
    tables.append(of_methods("over_fabrics", over, values, columns))
    least, most = (fabric_table(records, end) for end in (min, max))
    for role, part in parts_of(frames["errors_by_fabric"], "role"):
        tables.append(_by_fabric(part, least.loc[part.index], most.loc[part.index], values, role))
    return tables


def _by_fabric(errors: pd.DataFrame, least: pd.DataFrame, most: pd.DataFrame, values: Values, role: str) -> ResultTable:
    """Return the MSE of every method on every fabric, a column a fabric; the lowest of a column is strong."""
    labels = [name for name in errors.columns if name not in ("role", "fabric") and errors[name].notna().any()]
    keys = pd.DataFrame([label.partition(" ")[::2] for label in labels], columns=["method", "setting"])
    lowest = errors[labels].min(axis=1)

    def column(index: Any, fabric: str) -> Column:
        def cell(row: Any) -> TableCell:
            label = f"{row.method} {row.setting}".strip()
            value, low, high = (part.loc[index, label] for part in (errors, least, most))
            trainings = span(scientific, low, high) if low < high and not missing(value) else ""
            return TableCell(scientific(value), range=trainings, strong=value == lowest[index])

        return Column(plain(fabric), cell)

    columns = {str(name): column(index, str(name)) for index, name in errors["fabric"].items()}
    return of_methods("by_fabric", keys, {**values, "role": role}, columns, role)


def _equal_time(frame: pd.DataFrame, values: Values) -> list[ResultTable]:
    """Return for each measure but the diffuse one the errors of methods, and those of rivals in the same time."""
    tables = []
    for measure, part in parts_of(frame[frame["measure"] != "diffuse"], "measure"):
        sizes, lines = list(dict.fromkeys(part["size"])), []
        for (method, setting, rival), group in part.groupby(["method", "setting", "rival"], sort=False):
            line = [TableCell(display(str(rival)))]
            for row in rows(group.set_index("size").loc[sizes]):
                slow = NONE if missing(row.ns) else "too slow"
                other = slow if missing(row.rival_error) else times(row.ratio)
                line.append(TableCell(f"{percent(row.error)} · {other}", strong=row.ratio < 1.0))
            lines.append(method_row(str(method), str(setting), line))
        known = {**values, "measure": measure.capitalize()}
        tables.append(table("equal_time", ["method", "rival", *sizes], lines, known, measure))
    return tables


def _scenes(frame: pd.DataFrame, values: Values) -> list[ResultTable]:
    """Return the table of every scene; its last row is what the noise of the truth alone scores."""
    columns, tables = _measured_columns("fovvideovdp", "scenes", frame, values), []
    time = columns["frame_time"]
    columns["frame_time"] = Column(time.title, lambda row: TableCell(str(time.cell(row)), strong=bool(row.front)))
    floors = {"mse": "truth_noise"} | {name: f"{name}_floor" for name in columns if f"{name}_floor" in METRICS}
    for scene, part in parts_of(frame, "scene"):
        noise = [TableCell(shown(name, part[floors[name]].mean()) if name in floors else NONE) for name in columns]
        made = of_methods("scenes", part, {**values, "scene": plain(scene)}, columns, scene)
        tables.append(made._replace(rows=(*made.rows, TableRow("noise of the truth", tuple(noise), kind="noise"))))
    return tables


def _energy(frames: Frames, values: Values) -> list[ResultTable]:
    """Return the largest albedos, with errors and times; those above 1 are marked."""

    def albedo(name: str, column: Column) -> Column:
        def cell(row: Any) -> TableCell:
            made = column.cell(row)
            largest = max(getattr(row, name), np.nan_to_num(getattr(row, name + MOST)))
            return made._replace(text=made.text + (" ✗" if largest > 1.0 else ""))

        return Column(column.title, cell)

    frame, errors, keys = frames["energy"], frames["errors"], ["method", "setting"]
    seen = errors[errors["role"] == "seen"] if len(errors) else errors
    for column, part in (("mse", seen), ("median_ns", frames["timing"])):
        known = part[[*keys, column]] if len(part) else frame[keys].assign(**{column: math.nan})
        frame = frame.merge(known, on=keys, how="left")
    columns = columns_for("energy", values)
    columns |= {name: albedo(name, column) for name, column in columns.items() if name.startswith("furnace")}
    return [of_methods("energy", frame, values, columns)]


def _latents(records: Sequence[Record], frames: Frames, values: Values) -> list[ResultTable]:
    tables = []
    if "between" in frames:
        frame, lines = frames["between"], []
        for key, part in frame.groupby(["method", "setting", "fabric", "to", "how"], sort=False):
            method, setting, fabric, to, how = map(str, key)
            path = [f"{plain(fabric)} → {plain(to)}", how, *map(percent, part["error"])]
            lines.append(method_row(method, setting, map(TableCell, path)))
        shares = [f"t = {share:g}" for share in dict.fromkeys(frame["share"])]
        tables.append(table("between", ["method", "from → to", "way", *shares], lines, values))
    encodings = [record for record in records if record.metric == "encoding_error"]
    if encodings:
        lines = []
        for record in encodings:
            points = ", ".join(f"{x:g}: {100.0 * y:.3g}" for x, y in record.curve)
            cells = plain(record.fabric), record.note, points
            lines.append(method_row(record.method, record.setting, map(TableCell, cells)))
        tables.append(table("encodings", ["method", "fabric", "samples or latents", "errors, %"], lines, values))
    edits = to_table(record for record in records if record.metric == "encode_time")
    columns = {
        "note": text("edit", lambda row: str(row.note)),
        "value": text("median", lambda row: f"{row.value:.3g} {row.unit}"),
        "ends": text("quartiles", lambda row: NONE if missing(row.low) else f"{row.low:.3g} … {row.high:.3g}"),
    }
    return [*tables, of_methods("edits", edits, values, columns)]


def _timing(frame: pd.DataFrame, values: Values) -> ResultTable:
    few, many = (frame[name].max() if len(frame) else math.nan for name in ("threads", "most_threads"))
    more = f", {many:.0f} threads" if many > 1 else ", more threads"
    words = {**values, "fewer": f", {few:.0f} threads" if few > 1 else "", "more": more}
    return of_methods("timing", frame, words, _measured_columns("unseen_ns", "timing", frame, words))


def _measured_columns(optional: str, name: str, frame: pd.DataFrame, values: Values) -> dict[str, Column]:
    """Return the columns of a table, without an optional one that was not measured."""
    columns = columns_for(name, values, frame.columns).items()
    return {key: column for key, column in columns if key != optional or (key in frame and frame[key].notna().any())}


def entry_class(largest: float) -> str:
    """Return the class of an entry, from the larger of its multiply-adds for a query and its bytes for a fabric."""
    return next((f"≤ {limit // 1000} k" for limit in ENTRY_CLASSES if largest <= limit), "open")


def _entries(records: Sequence[Record], values: Values) -> ResultTable:
    stated: dict[str, dict[str, Record]] = {}
    for record in records:
        if metric_row(record.metric).table == "entries":
            stated.setdefault(record.method, {})[record.metric] = record
    lines = []
    for method, of in stated.items():
        largest = max(of["stated_bytes"].value, of["stated_multiply_adds"].value)
        cells = [entry_class(largest), *(shown(name, of[name].value) for name in _STATED)]
        lines.append(method_row(method, "", map(TableCell, [*cells, *(of[name].note for name in _NOTES.values())])))
    titles = [metric_row(name).title for name in _STATED]
    return table("entries", ["method", "class", *titles, *_NOTES], lines, values)


def _other(frames: Frames, values: Values) -> list[ResultTable]:
    """Return the metrics without a table of their own, each with its unit and which direction is better."""

    def column(name: str) -> Column:
        row = metric_row(name)
        title = row.title + (f", {row.unit}" if row.unit != "1" else "")
        return number(name, title + (f" ({row.better} is better)" if row.better else ""), row.format)

    frame = frames.get(OTHER, pd.DataFrame())
    columns = {name: column(name) for name in frame.columns[2:] if f"{name}{MOST}" in frame}
    return [of_methods(OTHER, frame, values, columns)]


def _extremes(frames: Frames, values: Values) -> list[ResultTable]:
    """Return methods at their extremes; impossible answers are marked."""

    def wrong(name: str, title: str) -> Column:
        return text(title, lambda row: f"{count} of {row.answers} ✗" if (count := getattr(row, name)) else "0")

    columns = {error_name(size): number(error_name(size), f"σ {size:g}", "percent") for size in FOOTPRINTS}
    columns |= columns_for("extremes", values)
    columns |= {name: wrong(name, columns[name].title) for name in ("not_finite", "negative")}
    return [of_methods("extremes", frames.get("extremes", pd.DataFrame()), values, columns)]


def _truth_tables(records: Sequence[Record], values: Values) -> dict[str, list[ResultTable]]:
    """Return the tables of the ground truth itself, of its sampler, of path-traced frames and of fits, by section."""
    whole: dict[str, float] = {}
    for row in effort.RECORDS.from_records(records):
        whole[row.fabric] = whole.get(row.fabric, 0.0) + row.share * row.seconds
    marks = {"below": " ✓", "above": " ✗", "open": ""}
    last = {
        "stability": text("result", lambda row: row.fault or "ok"),
        "truth_bias": text("standard error", lambda row: percent(row.standard_error, 2) + marks[row.result]),
        "truth_effort": text("share of the time", lambda row: percent(row.share * row.seconds / whole[row.fabric], 0)),
    }
    rates = [record for record in records if record.metric == "rate"]
    tables = {"rates": [of_rows("rates", rates, _RATES, values)]}
    for name, kept in _KEPT.items():
        section = "accuracy" if name.startswith("truth_") else name
        columns = [*_columns_of(kept), *([last[name]] if name in last else [])]
        tables.setdefault(section, []).append(of_rows(name, kept.from_records(records), columns, values))
    return tables


def _columns_of(kept: RowRecords[Any]) -> list[Column]:
    """Return the columns of rows that are kept as Records: what names a row, then its metrics."""

    def named(name: str) -> Column:
        return text(name, lambda row: getattr(row, name) if name == "expression" else plain(getattr(row, name)))

    known = {part.name for part in fields(kept.row)}
    columns = [named(name) for name in ("fabric", kept.method_field, *kept.setting) if name in known]
    for index, (field, metric) in enumerate(kept.metrics.items()):
        columns.append(number(field, metric=metric, ends=("", "") if index else ("low", "high")))
    return columns


def _truth_facts(records: Sequence[Record]) -> dict[str, object]:
    """Return the values of words (`tables.toml`) about the truth: limits, and how much was measured."""
    accuracies, calibrations = (part.RECORDS.from_records(records) for part in (accuracy, calibration))
    limits = {"exceeded": calibration.EXCEEDED, "limit": bias.LIMIT, "target": effort.RELATIVE_ERROR}
    values: dict[str, object] = {name: percent(limit) for name, limit in limits.items()}
    if accuracies:
        values["reference"] = percent(max(row.reference for row in accuracies), 2)
        values["accuracy_count"] = max(row.count for row in accuracies)
    if counts := [row.count for row in calibrations]:
        values |= {"calibration_rows": max(counts), "calibration_count": sum(counts)}
    return values


_STUDIES: Final = (
    finding, accuracy, calibration, bias, effort, footprint_colours, sampling, path_traced, measured_cloth,
)  # fmt: skip
_KEPT: Final[dict[str, RowRecords[Any]]] = {study.RECORDS.table: study.RECORDS for study in _STUDIES}
"""Measurements of the truth itself, of its sampler, of path tracing and of fits, by the names of their tables."""

_RATES: Final = (
    text("measurement", lambda row: row.setting),
    text("fabric", lambda row: row.fabric or NONE),
    text("rate", lambda row: f"{row.value:,.3g} {row.unit}"),
    text("note", lambda row: row.note),
)
