"""HTML of a page: one template, its macros, its style sheet and a section a file, filled with rows and sentences."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any, Final

import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined

from reports.images import tiles
from reports.measure import latents
from reports.measure.extremes import extremes_table
from reports.over_seeds import first_training, trainings
from reports.page.alt_texts import PLOT_TITLES, alt_texts
from reports.page.colours import DARK, LIGHT, Scheme
from reports.page.content import PageInput
from reports.page.fabric_card import fabric_card
from reports.page.filmstrip import SHOWN
from reports.page.picture_strips import films, strips
from reports.record import TRUTH, Record
from reports.tables import method_rows, scene_rows, summary, truth_rows
from reports.tables.caveats import caveats, lacking, unseen_by_eye
from reports.tables.definitions import definitions
from reports.tables.headline import headline, learnt
from reports.tables.machine_load import waiting
from reports.tables.number_format import display, percent, plain
from reports.tables.sentences import (
    beaten,
    cheapest_sentences,
    equal_time_sentences,
    least_flicker_sentences,
    scene_sentences,
)
from reports.truth import accuracy, bias, calibration, effort, footprint_colours, path_traced, sampling
from reports.truth.finding import RECORDS as FINDINGS

SECTIONS: Final = {
    "error": "Error",
    "equal-time": "Error at equal time",
    "pictures": "Pictures",
    "live": "Live",
    "scenes": "Scenes",
    "aliasing": "Aliasing",
    "energy": "Energy",
    "latents": "Between fabrics",
    "silhouettes": "Silhouettes",
    "time": "Time and storage",
    "other": "Other measurements",
    "stability": "Stability",
    "rates": "Speed of the truth",
    "accuracy": "Cost of accuracy",
    "sampler": "Importance sampling",
    "traced": "Path-traced frames",
    "fabrics": "Fabrics",
    "made": "Recipe, data and machine",
    "columns": "Definitions",
    "limits": "Limits",
}
"""Sections in their order: name of the template, and words of the link to it."""

ALWAYS: Final = frozenset({"error", "fabrics", "made", "columns", "limits"})
"""Sections that every page has; the others are left out where nothing was measured."""


def page_html(page: PageInput, tables: Mapping[str, pd.DataFrame], plots: Collection[str]) -> str:
    """Return the HTML of a page.

    Parameters
    ----------
    page : PageInput
        Its content.
    tables : mapping
        From `reports.page.page.page_tables`.
    plots : collection of str
        Names of the plots that were drawn.
    """
    content = {
        **_methods(page, tables),
        **_pictures(page, tables),
        **_truth(page),
        "page": page,
        "live": {fabric: plain(fabric) for fabric in page.live},
        "plots": plots,
        "plot_titles": PLOT_TITLES,
        "alt_texts": alt_texts(tables),
        "definitions": definitions(),
        "schemes": schemes(page),
        "display": display,
        "table_names": sorted(tables),
    }
    environment = Environment(
        loader=PackageLoader("reports.page"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    sections = [(name, title) for name, title in SECTIONS.items() if name in ALWAYS or _has(content, name)]
    return environment.get_template("page.html.j2").render(content, sections=sections)


def _methods(page: PageInput, tables: Mapping[str, pd.DataFrame]) -> dict[str, Any]:
    """Return sentences and rows about the methods."""
    errors, timing, other = tables["errors"], tables["timing"], summary.other_table(page.records)
    per_material = [note.name for note in page.models if note.per_material]
    without_training = untrained(page)
    return {
        "headlines": _headlines(errors, timing, without_training),
        "figures_of_merit": method_rows.figures_of_merit(page.records, errors, timing, without_training),
        "front": method_rows.front_rows(tables["tradeoff"]),
        "front_columns": method_rows.FRONT,
        "cheapest": cheapest_sentences(tables["tradeoff"]),
        "least_flicker": least_flicker_sentences(tables["tradeoff"]),
        "beaten": beaten(tables["tradeoff"]),
        "equal_time": method_rows.equal_time_rows(tables["equal_time"]),
        "equal_time_sentences": equal_time_sentences(tables["equal_time"]),
        "most_trainings": max(trainings(page.records).values(), default=0),
        "errors": method_rows.error_rows(errors, per_material),
        "error_columns": method_rows.ERROR,
        "over_fabrics": method_rows.over_fabrics_rows(errors),
        "over_fabrics_columns": method_rows.OVER_FABRICS,
        "by_fabric": method_rows.fabric_rows(tables["errors_by_fabric"], summary.fabric_ranges(page.records)),
        "aliasing": method_rows.aliasing_rows(tables["aliasing"], page.records),
        "energy": method_rows.energy_rows(tables["energy"], errors, timing),
        "energy_columns": method_rows.ENERGY,
        "silhouettes": method_rows.silhouette_rows(tables["silhouettes"]),
        "silhouette_columns": method_rows.SILHOUETTE,
        "timing": method_rows.timing_rows(timing),
        "timing_columns": method_rows.timing_columns(timing),
        "paths": method_rows.path_rows(summary.path_table(page.records)),
        "edits": method_rows.edit_rows(page.records),
        "shares": [f"t = {share:g}" for share in latents.SHARES],
        "extremes": method_rows.extreme_rows(extremes_table(page.records)),
        "extreme_columns": method_rows.EXTREMES,
        "other": method_rows.other_rows(other),
        "other_columns": method_rows.other_columns(other),
        "caveats": [
            *caveats(page.options, per_material, errors),
            *waiting(page.records),
            *lacking(page.records),
            *unseen_by_eye(page.records),
        ],
    }


def _pictures(page: PageInput, tables: Mapping[str, pd.DataFrame]) -> dict[str, Any]:
    """Return fabrics, scenes and the order of their pictures."""
    views = strips(
        page.pictures,
        {fabric.name: role for fabric, role in page.fabrics},
        [*page.options.views, *page.options.scenes.names],
        [tables["pictures"], summary.scene_table(first_training(page.records))],
    )
    return {
        "fabrics": [fabric_card(fabric, role) for fabric, role in page.fabrics],
        "shown": {(file.fabric, file.scene) for file in page.pictures if file.method == TRUTH},
        "strips": [view for view in views if view.fabric],
        "scenes": scene_rows.scene_rows(tables["scenes"]),
        "scene_columns": [column.title for column in scene_rows.scene_columns(tables["scenes"])],
        "scene_strips": {view.scene: view for view in views if not view.fabric},
        "scene_sentences": scene_sentences(tables["scenes"]),
        "films": films(page.pictures),
        "film_frames": min(page.options.scenes.frames, SHOWN),
        "relative_range": tiles.RELATIVE_RANGE,
        "difference_range": tiles.DIFFERENCE_RANGE,
    }


def _truth(page: PageInput) -> dict[str, Any]:
    """Return rows about the truth itself: rounding, speed, accuracy, calibration, bias, effort; sampling, paths."""
    measured = truth_measurements(page.records)
    accuracies = truth_rows.accuracy_rows(measured["truth_accuracy"])
    return {
        "stability": truth_rows.stability_rows(FINDINGS.from_records(page.records)),
        "rates": truth_rows.rate_rows(page.records),
        "accuracies": accuracies,
        "reference": percent(max((row.reference for row in measured["truth_accuracy"]), default=0.0), 2),
        "accuracy_count": max((row.count for row in measured["truth_accuracy"]), default=0),
        "calibrations": truth_rows.calibration_rows(measured["truth_calibration"]),
        "calibration_rows": max((row.count for row in measured["truth_calibration"]), default=0),
        "calibration_count": sum(row.count for row in measured["truth_calibration"]),
        "exceeded": percent(calibration.EXCEEDED),
        "biases": truth_rows.bias_rows(measured["truth_bias"]),
        "efforts": truth_rows.effort_rows(measured["truth_effort"]),
        "colour_losses": truth_rows.colour_rows(measured["truth_colours"]),
        "samplers": truth_rows.sampler_rows(measured["sampler"]),
        "traced": truth_rows.traced_rows(measured["traced"]),
        "limit": percent(bias.LIMIT),
        "target": percent(effort.RELATIVE_ERROR),
        "columns": {
            "accuracy": truth_rows.ACCURACY,
            "calibration": truth_rows.CALIBRATION,
            "bias": truth_rows.BIAS,
            "effort": truth_rows.EFFORT,
            "colours": truth_rows.COLOURS,
            "sampler": truth_rows.SAMPLERS,
            "traced": truth_rows.TRACED,
        },
        "titles": {name: plain(name) for name in accuracies},
    }


def _has(content: Mapping[str, Any], section: str) -> bool:
    """Return whether there is anything to show in a section that not every page has."""
    names = {
        "equal-time": ("equal_time",),
        "pictures": ("strips",),
        "latents": ("paths", "edits"),
        "time": ("timing",),
        "stability": ("stability", "extremes"),
        "accuracy": ("accuracies",),
        "sampler": ("samplers",),
    }
    if section == "aliasing":
        return bool(content["aliasing"]["groups"])
    return any(len(content[name]) for name in names.get(section, (section,)))


def schemes(page: PageInput) -> dict[str, Scheme]:
    """Return both schemes with a colour for every method of the page."""
    names = [TRUTH, *(note.name for note in page.models)]
    return {scheme.name: scheme.naming(names) for scheme in (LIGHT, DARK)}


def untrained(page: PageInput) -> set[str]:
    """Return the names of the methods that learn nothing."""
    return {note.name for note in page.models if not note.learns}


def truth_measurements(records: Sequence[Record]) -> dict[str, Sequence[Any]]:
    """Return the measurements of the truth itself, of the sampler and of path tracing, by the names of their tables."""
    return {
        "truth_accuracy": accuracy.RECORDS.from_records(records),
        "truth_calibration": calibration.RECORDS.from_records(records),
        "truth_bias": bias.RECORDS.from_records(records),
        "truth_effort": effort.RECORDS.from_records(records),
        "truth_colours": footprint_colours.RECORDS.from_records(records),
        "sampler": sampling.RECORDS.from_records(records),
        "traced": path_traced.RECORDS.from_records(records),
    }


def _headlines(errors: pd.DataFrame, timing: pd.DataFrame, untrained: set[str]) -> list[str]:
    """Return a sentence for each learnt method; the first quotes the paper."""
    result: list[str] = []
    for key in learnt(errors, untrained) if len(errors) else []:
        if text := headline(*key, errors, timing, paper=not result):
            result.append(text)
    return result
