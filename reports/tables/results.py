"""Every table of a recipe's page as one Markdown file: reports/RESULTS.md, from the Records of the page alone."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from importlib.metadata import version
from typing import Any

import pandas as pd

from reports.measure.silhouette import silhouette_table
from reports.over_seeds import trainings
from reports.record import TRUTH, Machine, Record
from reports.tables import method_rows, scene_rows, summary, truth_rows
from reports.tables.equal_time import equal_time_table, size_table
from reports.tables.headline import BOUNDED, headline
from reports.tables.markdown import markdown_table
from reports.tables.number_format import (
    NONE,
    display,
    interval,
    listed,
    missing,
    percent,
    plain,
    scientific,
    significant,
    size,
    times,
)
from reports.tables.readme import three_decimals
from reports.tables.sentences import equal_time_sentences
from reports.truth import accuracy, bias, calibration, effort, footprint_colours, path_traced, sampling
from weaves.errors import BadInput


def results_page(records: Sequence[Record], machine: Machine, where: str) -> str:
    """Return the whole file.

    Parameters
    ----------
    records : sequence of Record
        Of one page.
    machine : Machine
        Where its times were taken.
    where : str
        File of the Records, for the error.

    Raises
    ------
    BadInput
        If no Record names its recipe.
    """
    named = [record.provenance for record in records if record.provenance.recipe]
    if not named:
        raise BadInput(where, "", "names no recipe", "Records of a whole page are needed")
    packages = ", ".join(f"{name} {found}" for name, found in machine.packages.items())
    head = [
        f"Recipe `{named[0].recipe}`, fingerprint `{named[0].recipe_fingerprint[:16]}`",
        f"Twillight {version('twillight')}, benchmark version {named[0].version}",
        f"Machine: {machine.cpu}, {machine.cores} cores, {machine.system}",
        f"Python {machine.python}, {packages}",
        f"Measured on {machine.date[:10]}",
    ]
    about = (
        f"Written by `make results RECIPE={named[0].recipe}` from the Records of the page; do not edit. The page "
        "defines every column and shows the pictures. What was tried and not kept is in [LOG.md](LOG.md)."
    )
    meta = "\n".join(f"- {line}" for line in head)
    parts = [f"# Results of the recipe `{named[0].recipe}`", about, meta, *_of_methods(records), *_of_scenes(records)]
    return "\n\n".join([*parts, *_of_the_truth(records)]) + "\n"


def _of_methods(records: Sequence[Record]) -> Iterator[str]:
    """Yield the sections on held-out queries: error, aliasing, time, energy, equal time."""
    errors, timing = summary.error_table(records), summary.timing_table(records)
    if len(errors):
        yield "## Error on held-out queries"
        yield (
            "MSE: mean squared error in the colours of each fabric, mean over fabrics, noise of the truth subtracted. "
            "× lower: MSE of two random points over that of the method, with its 95 % interval. Colour: relative RMSE "
            "of one colour for all fabrics. Colour, 99 %: the same without the hundredth of the queries that have the "
            "largest errors; most of them are patches of which almost nothing is seen." + _trainings(records)
        )
        for role in dict.fromkeys(errors["role"]):
            part = errors[errors["role"] == role]
            count = f"{part['fabrics'].max()} fabrics" if part["fabrics"].max() > 1 else "one fabric"
            yield f"### {str(role).capitalize()}: {count}, {part['queries'].max():,} queries"
            lines = [(_name(row), *_error_cells(row)) for row in summary.rows(part)]
            yield markdown_table(("method", "MSE", "× lower", "95 %", "colour", "colour, 99 %"), lines)
        if over := method_rows.over_fabrics_rows(errors):
            yield "### Over unseen fabrics: geometric means with their 95 % intervals over fabrics"
            yield _grouped(method_rows.OVER_FABRICS, over)
        found = [headline(*key, errors, timing, paper=key[0] == "woven") for key in _methods(errors)]
        if sentences := [f"- {sentence}" for sentence in found if sentence]:
            yield "\n".join(sentences)
    aliasing = summary.aliasing_table(records)
    if len(aliasing):
        yield "## Aliasing on a receding plane"
        yield (
            "Flicker: variance over time beyond that of the truth, over its squared mean. Excess energy: power above "
            "half the Nyquist frequency beyond that of the truth, over its squared mean."
        )
        lines = [
            (_name(row), row.role, *(_ranged(row, name, three_decimals) for name in ("flicker", "excess_energy")))
            for row in summary.rows(aliasing)
        ]
        yield markdown_table(("method", "fabrics", "flicker", "excess energy"), lines)
    if len(timing):
        yield "## Time and memory"
        yield "Median time of one query on one thread, with its quartiles; × time: over that of two random points."
        lines = [(_name(row), *_time_cells(row)) for row in summary.rows(timing)]
        yield markdown_table(("method", "ns a query", "quartiles", "× time", "bytes stored"), lines)
    energy = method_rows.energy_rows(summary.energy_table(records), errors, timing)
    if energy:
        yield "## Energy: largest directional albedo over all fabrics"
        yield _grouped(method_rows.ENERGY, energy)
    silhouettes = method_rows.silhouette_rows(silhouette_table(records))
    if silhouettes:
        yield "## Silhouettes of curved cloth"
        yield _grouped(method_rows.SILHOUETTE, silhouettes)
    yield from _at_equal_time(records)


def _at_equal_time(records: Sequence[Record]) -> Iterator[str]:
    """Yield the section that compares methods with rivals that have a parameter, at the same time."""
    table = equal_time_table(size_table(records))
    if table.empty:
        return
    yield "## At equal time"
    yield (
        "A method with one setting, and each setting of soft nodes, beside a method with a parameter, at the time of "
        "the former, by the size of the footprint in yarn spacings: error of the method · error of the rival over it. "
        "Below 1× the rival's is smaller."
    )
    yield "\n".join(f"- {sentence}" for sentence in equal_time_sentences(table))
    for measure, found in method_rows.equal_time_rows(table).items():
        yield f"### {measure.capitalize()}"
        lines = [(row["label"], row["rival"], *(cell["text"] for cell in row["cells"])) for row in found["rows"]]
        yield markdown_table(("method", "rival", *found["sizes"]), lines)


def _of_scenes(records: Sequence[Record]) -> Iterator[str]:
    """Yield one table a scene."""
    table = summary.scene_table(records)
    if table.empty:
        return
    columns = [column.title for column in scene_rows.scene_columns(table)]
    yield "## Scenes"
    yield "The last row is what the noise of the truth alone scores."
    for scene, found in scene_rows.scene_rows(table).items():
        yield f"### {plain(scene).capitalize()}"
        lines = [(row["label"], *_texts(_narrow(row["cells"]))) for group in found["groups"] for row in group["rows"]]
        yield markdown_table(("method", *columns), [*lines, ("noise of the truth", *found["noise"])])


def _of_the_truth(records: Sequence[Record]) -> Iterator[str]:
    """Yield what the studies of a recipe measured (`reports.options.StudyName`)."""
    rates, accuracies = truth_rows.rate_rows(records), accuracy.RECORDS.from_records(records)
    biases, efforts = bias.RECORDS.from_records(records), effort.RECORDS.from_records(records)
    samplers, traced = sampling.RECORDS.from_records(records), path_traced.RECORDS.from_records(records)
    calibrations = calibration.RECORDS.from_records(records)
    losses = footprint_colours.RECORDS.from_records(records)
    if rates or accuracies or biases or efforts:
        yield "## The ground truth (`twillight run truth`)"
    if rates:
        yield "### Speed"
        yield markdown_table(("what", "fabric", "rate", "note"), rates)
    for fabric, lines in truth_rows.accuracy_rows(accuracies).items():
        yield f"### Accuracy on {plain(fabric)}"
        yield markdown_table(("estimator", *truth_rows.ACCURACY), lines)
    if calibrations:
        yield "### Calibration of errors: rms(error) / rms(standard error) · share beyond the bound"
        yield markdown_table(("estimator", *truth_rows.CALIBRATION), truth_rows.calibration_rows(calibrations))
    if biases:
        yield "### Bias of tabulated answers: mean of each component against sampling"
        yield markdown_table(("fabric", *truth_rows.BIAS), truth_rows.bias_rows(biases))
    if efforts:
        yield "### Where the time of `auto` goes"
        yield markdown_table(("fabric", *truth_rows.EFFORT), truth_rows.effort_rows(efforts))
    if losses:
        yield "### Loss by mean colours of the footprint where ends and picks differ in colour"
        yield markdown_table(("fabric", *truth_rows.COLOURS), truth_rows.colour_rows(losses))
    if samplers:
        yield "## Sampling directions (`twillight run truth`)"
        yield (
            "How many times less variance than a cosine on both sides has, how many times less in equal time, and the "
            "time of one direction with its density."
        )
        yield markdown_table(("fabric", *truth_rows.SAMPLERS), truth_rows.sampler_rows(samplers))
    if traced:
        yield "## Path-traced frames (`twillight run mitsuba`)"
        yield (
            "Mean squared error of linear RGB over the squared mean of the frame, seconds of one processor, and the "
            "error of one random point a sample in equal time over this error."
        )
        yield markdown_table(("scene", *truth_rows.TRACED), truth_rows.traced_rows(traced))


def _methods(errors: pd.DataFrame) -> list[tuple[str, str]]:
    """Return every method without a setting or under the energy bound: no number of points, no other runtime."""
    keys = list(dict.fromkeys(zip(errors["method"], errors["setting"], strict=True)))
    return [key for key in keys if key[1] in ("", BOUNDED)]


def _name(row: Any) -> str:
    return "the truth" if row.method == TRUTH else display(row.method, row.setting)


def _error_cells(row: Any) -> tuple[str, ...]:
    if (row.method, row.setting) == summary.BASELINE:
        return scientific(row.mse), "1", NONE, percent(row.colour_rrmse), percent(row.colour_rrmse_99)
    ratio = _ranged(row, "ratio", times), interval(row.ratio_low, row.ratio_high)
    colour = (_ranged(row, name, percent) for name in ("colour_rrmse", "colour_rrmse_99"))
    return _ranged(row, "mse", scientific), *ratio, *colour


def _ranged(row: Any, column: str, worded: Callable[[float], str]) -> str:
    """Return a number in words, with its range over trainings where there are several."""
    return method_rows.plain_text(method_rows.ranged(worded(getattr(row, column)), row, column, worded))


def _trainings(records: Sequence[Record]) -> str:
    """Return a sentence on the numbers of several trainings; empty where there are none."""
    counts = sorted({count for count in trainings(records).values() if count > 1})
    if not counts:
        return ""
    return (
        f" Numbers of trained methods are means over {listed([str(count) for count in counts])} trainings with "
        "different seeds, in brackets the least and the most of them."
    )


def _time_cells(row: Any) -> tuple[str, ...]:
    quartiles = f"{row.first_quartile_ns:,.0f} … {row.third_quartile_ns:,.0f}"
    stored = NONE if row.method == TRUTH or missing(row.bytes_stored) else size(row.bytes_stored)
    return significant(row.median_ns), quartiles, times(row.time_ratio), stored


def _grouped(columns: Sequence[str], groups: Sequence[Any]) -> str:
    """Return a table from the page's groups of rows."""
    lines = [(row["label"], *_texts(row["cells"])) for group in groups for row in group["rows"]]
    return markdown_table(("method", *columns), lines)


def _narrow(cells: Sequence[Any]) -> list[Any]:
    """Return cells without their intervals, which the page has: a table of so many columns has no place for them."""
    return [cell | {"interval": ""} for cell in cells]


def _texts(found: Sequence[Any]) -> list[str]:
    """Return cells as text; on the page some are marked."""
    return [method_rows.plain_text(cell) for cell in found]
