"""The page: one folder with ``index.html``, its figures, tables and Records, which needs nothing else.

The same input gives the same bytes. Figures are written first and the page last: a page that exists is whole.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined

from pipeline.atomic import atomic_write
from pipeline.models.catalogue import CLASSES
from reports.images import tiles
from reports.images.exr import read_exr
from reports.images.film import film
from reports.measure import latents
from reports.measure.extremes import extremes_table
from reports.measure.silhouette import silhouette_table
from reports.options import BenchOptions
from reports.page import figures, front_figures
from reports.page.colours import DARK, LIGHT, Scheme
from reports.page.fabric_card import fabric_card
from reports.page.filmstrip import SHOWN, filmstrip, liveliest
from reports.page.picture_strips import PictureFile, films, strips
from reports.page.plot_style import render
from reports.record import OF_A_PAGE, TRUTH, Machine, Record, Role, to_table, write_records
from reports.tables import method_rows, scene_rows, summary, truth_rows
from reports.tables.caveats import caveats, lacking, unseen_by_eye
from reports.tables.definitions import DEFINITIONS
from reports.tables.equal_time import equal_time_table, size_table
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
from reports.tables.tradeoff import tradeoff_table
from reports.truth import accuracy, bias, effort, sampling
from reports.truth.finding import RECORDS as FINDINGS
from reports.truth.finding import Finding
from weaves.fabric import Fabric


@dataclass(frozen=True)
class ModelNote:
    """What the page says of a method."""

    name: str
    """As in the recipe: tells several models of one kind apart."""
    about: str
    """In a few words: what it is and how it was trained."""
    fingerprint: str = ""
    """Of the trained model."""
    per_material: bool = False
    """Whether it learns each fabric by itself."""
    kind: str = ""
    """Which model it is, a key of `pipeline.models.options.CLASSES`; empty: that of its name."""

    @property
    def learns(self) -> bool:
        """Whether there is anything to train."""
        model = CLASSES.get(self.kind or self.name)
        return model is None or model.learns


@dataclass(frozen=True)
class PageInput:
    """Everything a page is made of."""

    recipe: str
    about: str
    fingerprint: str
    """Of the recipe."""
    dataset: str
    """Name and fingerprint of the data set."""
    fabrics: Sequence[tuple[Fabric, Role]]
    models: Sequence[ModelNote]
    options: BenchOptions
    records: Sequence[Record]
    machine: Machine
    """Where the times were taken."""
    pictures: Sequence[PictureFile]


def write_page(folder: Path, page: PageInput, progress: Callable[[float], None] = lambda fraction: None) -> Path:
    """Write a page into `folder` and return the path of ``index.html``.

    Parameters
    ----------
    folder : Path
        Created if need be.
    page : PageInput
        What was measured.
    progress : callable
        Told the share that is done.

    Raises
    ------
    BadInput
        If a picture is missing, or the folder cannot be written.
    """
    tables = {
        "records": to_table(page.records),
        "errors": summary.error_table(page.records),
        "errors_by_fabric": summary.fabric_table(page.records),
        "pictures": summary.picture_table(page.records),
        "aliasing": summary.aliasing_table(page.records),
        "timing": summary.timing_table(page.records),
        "energy": summary.energy_table(page.records),
        "silhouettes": silhouette_table(page.records),
    }
    tables["tradeoff"] = tradeoff_table(tables["errors"], tables["timing"], tables["aliasing"])
    tables["scenes"] = summary.scene_table(page.records)
    tables["by_size"] = size_table(page.records)
    tables["equal_time"] = equal_time_table(tables["by_size"])
    between = summary.path_table(page.records)
    if len(between):
        tables["between"] = between
    extremes = extremes_table(page.records)
    if len(extremes):
        tables["extremes"] = extremes
    findings = FINDINGS.from_records(page.records)
    if findings:
        tables["stability"] = pd.DataFrame([asdict(finding) for finding in findings])
    for name, measured in _of_the_truth(page.records).items():
        if measured:
            tables[name] = pd.DataFrame([asdict(one) for one in measured])
    for name, table in tables.items():
        write_table(folder / "tables" / name, table)
    progress(0.1)
    images = dict(_plots(tables, page))
    for name, content in images.items():
        atomic_write(folder / "figures" / name, content)
    progress(0.4)
    for done, (name, content) in enumerate(_tiles(page)):
        atomic_write(folder / "figures" / name, content)
        progress(0.4 + 0.6 * min(1.0, (done + 1) / (3 * len(page.pictures) + 3 * len(page.fabrics) + 1)))
    write_records(folder / OF_A_PAGE, page.records, page.machine)
    index = folder / "index.html"
    atomic_write(index, _html(page, tables, findings, {name.removesuffix("-light.png") for name in images}).encode())
    return index


def write_table(path: Path, table: pd.DataFrame) -> None:
    """Write a table as ``path.csv`` and ``path.parquet``; equal tables give equal bytes."""
    atomic_write(path.with_suffix(".csv"), table.to_csv(index=False, lineterminator="\n").encode())
    buffer = io.BytesIO()
    table.to_parquet(buffer, index=False, compression="zstd")
    atomic_write(path.with_suffix(".parquet"), buffer.getvalue())


def _of_the_truth(records: Sequence[Record]) -> dict[str, Sequence[Any]]:
    """Return what `bench truth` measured beside speeds, and `bench sampler`, by the names of their tables."""
    return {
        "truth_accuracy": accuracy.RECORDS.from_records(records),
        "truth_bias": bias.RECORDS.from_records(records),
        "truth_effort": effort.RECORDS.from_records(records),
        "sampler": sampling.RECORDS.from_records(records),
    }


def _schemes(page: PageInput) -> dict[str, Scheme]:
    """Return both schemes with a colour for every method of the page."""
    names = [TRUTH, *(note.name for note in page.models)]
    return {scheme.name: scheme.naming(names) for scheme in (LIGHT, DARK)}


def _untrained(page: PageInput) -> set[str]:
    """Return the names of the methods that learn nothing."""
    return {note.name for note in page.models if not note.learns}


def _plots(tables: dict[str, pd.DataFrame], page: PageInput) -> Iterator[tuple[str, bytes]]:
    """Draw every plot that there are numbers for, in both schemes."""
    errors, timing, aliasing = tables["errors"], tables["timing"], tables["aliasing"]
    curves = summary.spectra(page.records)
    plots: dict[str, tuple[Any, ...]] = {}
    if len(errors):
        plots["errors"] = (figures.errors, errors, tables["errors_by_fabric"])
    if tables["tradeoff"]["error"].notna().any():
        plots["error-against-time"] = (front_figures.error_against_time, tables["tradeoff"])
        plots["error-against-bytes"] = (front_figures.error_against_bytes, tables["tradeoff"])
    if tables["tradeoff"]["flicker"].notna().any():
        plots["aliasing-against-time"] = (front_figures.aliasing_against_time, tables["tradeoff"])
    if len(tables["by_size"]):
        plots["error-by-size"] = (front_figures.error_by_size, tables["by_size"])
    if tables["scenes"]["frame_time"].notna().any():
        plots["scenes"] = (front_figures.scenes, tables["scenes"])
    if len(aliasing):
        plots["aliasing"] = (figures.aliasing, aliasing)
    if curves:
        plots["spectra"] = (figures.spectra, curves)
    if len(timing):
        plots["timing"] = (figures.timing, timing)
    for name, (plot, *data) in plots.items():
        for scheme in _schemes(page).values():
            yield f"{name}-{scheme.name}.png", render(plot, scheme, *data)


def _tiles(page: PageInput) -> Iterator[tuple[str, bytes]]:
    """Draw every picture, every difference, every strip of frames, and the maps of every fabric."""
    truths = {(p.fabric, p.scene): read_exr(p.path) for p in page.pictures if p.method == TRUTH}
    for file in page.pictures:
        exr = truths[file.fabric, file.scene] if file.method == TRUTH else read_exr(file.path)
        yield f"{file.stem}.png", tiles.picture(exr)
        if file.method != TRUTH and file.fabric:
            yield f"{file.stem}-difference.png", tiles.difference(exr, truths[file.fabric, file.scene])
        elif file.method != TRUTH:
            yield f"{file.stem}-relative.png", tiles.relative_tile(exr)
            yield f"{file.stem}-flip.png", tiles.flip_tile(exr)
    for scene, files in films(page.pictures).items():
        shown = {file.stem: film(read_exr(file.path)) for file in files}
        yield f"film-{scene}.png", filmstrip(shown, liveliest(shown))
    for fabric, _ in page.fabrics:
        for kind, draw in (("drawdown", tiles.drawdown), ("height", tiles.height), ("normals", tiles.normals)):
            yield f"{fabric.name}-{kind}.png", draw(fabric)
    spheres = [exr for (fabric, scene), exr in truths.items() if fabric and scene == "sphere"]
    if spheres:
        yield "overview.png", tiles.overview(spheres, columns=-(-len(spheres) // 2))


def _html(page: PageInput, tables: dict[str, pd.DataFrame], findings: Sequence[Finding], plots: set[str]) -> str:
    errors, timing = tables["errors"], tables["timing"]
    per_material = [note.name for note in page.models if note.per_material]
    untrained, schemes = _untrained(page), _schemes(page)
    environment = Environment(
        loader=PackageLoader("reports.page"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    fabrics = [fabric_card(fabric, role) for fabric, role in page.fabrics]
    measured = _of_the_truth(page.records)
    shown = {(file.fabric, file.scene) for file in page.pictures if file.method == TRUTH}
    views = strips(
        page.pictures,
        {fabric.name: role for fabric, role in page.fabrics},
        [*page.options.views, *page.options.scenes.names],
        [tables["pictures"], tables["scenes"]],
    )
    return environment.get_template("page.html.j2").render(
        page=page,
        headlines=_headlines(errors, timing, untrained),
        figures_of_merit=method_rows.figures_of_merit(page.records, errors, timing, untrained),
        front=method_rows.front_rows(tables["tradeoff"]),
        front_columns=method_rows.FRONT,
        cheapest=cheapest_sentences(tables["tradeoff"]),
        least_flicker=least_flicker_sentences(tables["tradeoff"]),
        beaten=beaten(tables["tradeoff"]),
        equal_time=method_rows.equal_time_rows(tables["equal_time"]),
        equal_time_sentences=equal_time_sentences(tables["equal_time"]),
        errors=method_rows.error_rows(errors, per_material),
        by_fabric=method_rows.fabric_rows(tables["errors_by_fabric"]),
        aliasing=method_rows.aliasing_rows(tables["aliasing"], page.records),
        energy=method_rows.energy_rows(tables["energy"], errors, timing),
        energy_columns=method_rows.ENERGY,
        silhouettes=method_rows.silhouette_rows(tables["silhouettes"]),
        silhouette_columns=method_rows.SILHOUETTE,
        timing=method_rows.timing_rows(timing),
        timing_columns=method_rows.timing_columns(timing),
        paths=method_rows.path_rows(summary.path_table(page.records)),
        edits=method_rows.edit_rows(page.records),
        shares=[f"t = {share:g}" for share in latents.SHARES],
        stability=truth_rows.stability_rows(findings),
        extremes=method_rows.extreme_rows(extremes_table(page.records)),
        extreme_columns=method_rows.EXTREMES,
        rates=truth_rows.rate_rows(page.records),
        accuracies=truth_rows.accuracy_rows(measured["truth_accuracy"]),
        reference=percent(max((row.reference for row in measured["truth_accuracy"]), default=0.0), 2),
        accuracy_count=max((row.count for row in measured["truth_accuracy"]), default=0),
        biases=truth_rows.bias_rows(measured["truth_bias"]),
        efforts=truth_rows.effort_rows(measured["truth_effort"]),
        samplers=truth_rows.sampler_rows(measured["sampler"]),
        limit=percent(bias.LIMIT),
        asked=percent(effort.RELATIVE_ERROR),
        columns={
            "accuracy": truth_rows.ACCURACY,
            "bias": truth_rows.BIAS,
            "effort": truth_rows.EFFORT,
            "sampler": truth_rows.SAMPLERS,
        },
        titles={name: plain(name) for name in truth_rows.accuracy_rows(measured["truth_accuracy"])},
        strips=[view for view in views if view.fabric],
        scenes=scene_rows.scene_rows(tables["scenes"]),
        scene_columns=[column.title for column in scene_rows.scene_columns(tables["scenes"])],
        scene_strips={view.scene: view for view in views if not view.fabric},
        films=films(page.pictures),
        scene_sentences=scene_sentences(tables["scenes"]),
        relative_range=tiles.RELATIVE_RANGE,
        display=display,
        film_frames=min(page.options.scenes.frames, SHOWN),
        fabrics=fabrics,
        shown=shown,
        plots=plots,
        definitions=DEFINITIONS,
        caveats=[
            *caveats(page.options, per_material, errors),
            *waiting(page.records),
            *lacking(page.records),
            *unseen_by_eye(page.records),
        ],
        colours={name: scheme.colours([TRUTH, *(n.name for n in page.models)]) for name, scheme in schemes.items()},
        schemes=schemes,
        difference_range=tiles.DIFFERENCE_RANGE,
        table_names=sorted(tables),
    )


def _headlines(errors: pd.DataFrame, timing: pd.DataFrame, untrained: set[str]) -> list[str]:
    """Return a sentence for each learnt method; the first quotes the paper."""
    result: list[str] = []
    for key in learnt(errors, untrained) if len(errors) else []:
        if text := headline(*key, errors, timing, paper=not result):
            result.append(text)
    return result
