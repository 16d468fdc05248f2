"""HTML of a page: one template, its macros and style sheet, and a file for each section that is no list of tables."""

import re
from collections.abc import Callable, Mapping
from typing import Any, Final

import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from reports.catalogue import METRICS
from reports.images import tiles
from reports.images.tiles import hex_colour
from reports.over_seeds import first_training
from reports.page.colours import DARK, LIGHT, Scheme
from reports.page.content import PageInput
from reports.page.figures import DPI
from reports.page.pictures import SHOWN, films, strips
from reports.record import TRUTH
from reports.tables.number_format import display, listed, percent, plain, scientific, significant
from reports.tables.page_tables import ranged_frames, sections
from reports.tables.sentences import headline, lacking, learnt, own_figures, scene_sentences, trade
from reports.tables.summary import OF_PAPER, parts_of, rows, scene_table
from reports.tables.table import WORDS
from weaves.colour import EXPOSURE
from weaves.fabric import Fabric

FIRST_SIGHT: Final = frozenset({"trade", "error", "pictures", "live", "scenes", "traced", "measured"})
"""Sections that are open from the start."""

OPEN_ROWS: Final = 15  # rows of the longest table that is open from the start
_MOST_CHIPS: Final = 8  # different colours shown of a yarn's threads


def page_html(page: PageInput, frames: Mapping[str, pd.DataFrame], sizes: Mapping[str, tuple[int, int]]) -> str:
    """Return the HTML of a page.

    Its `frames` are from `reports.tables.page_tables.page_frames`; those of `ranged_frames` are shown. `sizes` are
    width and height, in pixels, of every picture and plot in ``figures``.
    """
    per_material = [note.name for note in page.models if note.per_material]
    every = sections(page.records, frames, _options(page), per_material)
    ranged = ranged_frames(frames)
    lead, figures = trade(ranged["tradeoff"])
    headlines = _headlines(page, ranged)
    if page.own and headlines:
        lead, *headlines = [headlines[0], lead, *headlines[1:]]
        figures = [*own_figures(page.own[0], ranged["errors"], ranged["timing"]), *figures[-1:]]
    content = {
        "page": page,
        "lead": lead,
        "headlines": list(filter(None, headlines)),
        "figures": figures,
        "paper_of": OF_PAPER in {note.name for note in page.models},
        "scene_sentences": scene_sentences(frames["scenes"]),
        "limits": [*every["limits"].intro, *lacking(page.records)],
        "live": {fabric: plain(fabric) for fabric in page.live},
        "sizes": sizes,
        "plot_scale": 108 / DPI,  # most pixels of the page for one of a plot: letters are as large as those of the text
        "plot_words": WORDS["plots"],
        "alt_texts": _alt_texts(ranged),
        "definitions": {row.title: row.definition for row in METRICS.values() if row.definition} | WORDS["definitions"],
        "schemes": schemes(page),
        "display": display,
        "frame_names": sorted(frames),
        "open_rows": OPEN_ROWS,
        "first_sight": FIRST_SIGHT,
        "first_cells": 7,  # pictures of a view that are shown from the start: a line of the page
        **_pictures(page, frames),
    }
    # These are on every page; the others are left out where nothing was measured.
    always = {"fabrics", "made", "columns", "limits"}
    always |= {name for name, key in (("live", "live"), ("pictures", "strips")) if content[key]}
    shown = [section for name, section in every.items() if section.tables or name in always]
    environment = Environment(loader=PackageLoader("reports.page"), autoescape=True, undefined=StrictUndefined)
    environment.trim_blocks = environment.lstrip_blocks = True
    environment.filters["prose"] = prose
    return environment.get_template("page.html.j2").render(content, sections=shown)


def prose(text: str) -> Markup:
    """Return a text as HTML; what stands between backticks is code."""
    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(text))))


def schemes(page: PageInput) -> dict[str, Scheme]:
    """Return both schemes with a colour for every method of the page."""
    names = [TRUTH, *(note.name for note in page.models)]
    return {scheme.name: scheme.naming(names) for scheme in (LIGHT, DARK)}


def _options(page: PageInput) -> dict[str, object]:
    options, view, scenes = page.options, page.options.view, page.options.scenes
    footprints = {
        "major": "its longer axis: it blurs towards the horizon, and the truth itself does not alias",
        "geometric_mean": "the geometric mean of its axes: the truth is sharper, and shows moiré of its own",
    }
    return {
        "plot": "plot",
        "frames": options.frames,
        "step": view.step,
        "width": scenes.size[0],
        "height": scenes.size[1],
        "scene_frames": scenes.frames,
        **dict(zip(("picture_width", "picture_height"), scenes.picture_size or (), strict=False)),
        "film_frames": min(scenes.frames, SHOWN),
        "diameter": f"{2 * options.edge.radius:g}",
        "depth": f"{options.edge.depth:g}",
        "footprint": footprints[view.footprint],
        "largest_angle": f"{view.largest_angle:g}°",
        "exposure": EXPOSURE,
        "irradiance": f"{view.irradiance:.3g}",
        "difference_range": f"{tiles.DIFFERENCE_RANGE:.0%}",
    }


def _headlines(page: PageInput, frames: Mapping[str, pd.DataFrame]) -> list[str]:
    """Return a sentence for each method from outside, then for each learnt one, published ones first."""
    published = {note.name for note in page.models if note.published}
    untrained = {note.name for note in page.models if not note.learns} - set(page.own)
    keys = learnt(frames["errors"], untrained)
    keys.sort(key=lambda key: (key[0] not in page.own, key[0] not in published))
    sentences = (headline(*key, frames["errors"], frames["timing"], paper=key[0] == OF_PAPER) for key in keys)
    return list(filter(None, sentences))


def _pictures(page: PageInput, frames: Mapping[str, pd.DataFrame]) -> dict[str, Any]:
    """Return fabrics, and the pictures of fabrics and scenes in their order."""
    views = strips(
        page.shown,
        [fabric.name for fabric, _ in page.fabrics],
        [*page.options.views, *page.options.scenes.names],
        [frames["pictures"], scene_table(first_training(page.records))],
        page.models,
    )
    return {
        "fabrics": [fabric_card(fabric, role) for fabric, role in page.fabrics],
        "shown": {(file.fabric, file.scene) for file in page.pictures if file.method == TRUTH},
        "strips": [view for view in views if view.fabric],
        "scene_strips": {view.scene: view for view in views if not view.fabric},
        "films": films(page.pictures),
        "film_frames": min(page.options.scenes.frames, SHOWN),
        "relative_range": tiles.RELATIVE_RANGE,
        "difference_range": tiles.DIFFERENCE_RANGE,
    }


def fabric_card(fabric: Fabric, role: str) -> dict[str, Any]:
    """Return the title, weave, source and yarns of a fabric as text, and the colours of the yarns."""
    ends, picks = fabric.weave.repeat
    yarns = []
    families = zip(("warp", "weft"), (fabric.warp, fabric.weft), fabric.thread_colours(), strict=True)
    for family, yarn, threads in families:
        numbers = [f"{yarn.bend:.3g}°", f"{yarn.twist:.3g}°".replace("-", "−")]
        numbers += [f"{value:.3g}" for value in (yarn.roughness, yarn.relief, yarn.width)]
        colours, more = [], 0
        for kind in ("diffuse", "specular"):
            different = list(dict.fromkeys(hex_colour((EXPOSURE * rgb).tolist()) for rgb in getattr(threads, kind)))
            colours += [(kind, shown) for shown in different[:_MOST_CHIPS]]
            more += len(different[_MOST_CHIPS:])
        yarns.append({"family": family, "cells": numbers, "colours": colours, "more": more})
    return {
        "name": fabric.name,
        "title": plain(fabric.name),
        "role": role,
        "weave": fabric.weave.name,
        "repeat": f"{ends} ends × {picks} picks",
        "source": fabric.source,
        "yarns": yarns,
    }


def _alt_texts(tables: Mapping[str, pd.DataFrame]) -> dict[str, str]:
    """Return the alternative text of every plot by its name, from the frames of a page.

    For screen readers: the words of `tables.toml`, and the lowest and highest values.
    """
    tradeoff, timing, scenes = tables["tradeoff"], tables["timing"], tables["scenes"]
    flicker = tables["aliasing"].assign(distance=tables["aliasing"]["flicker"].abs())
    values = {
        "error-against-time": _fronts(tradeoff, "front"),
        "error-against-bytes": _fronts(tradeoff, "front_bytes"),
        "errors": _by_role(tables["errors"], "mse", scientific),
        "error-by-size": _ends(tables["by_size"], "colour", percent),
        "scenes": "".join(_ends(part, "mse", scientific, f" in {plain(x)}") for x, part in parts_of(scenes, "scene")),
        "aliasing-against-time": _fronts(tradeoff, "front_flicker"),
        "aliasing": _by_role(flicker, "distance", scientific, " distance of the flicker"),
        "timing": _ends(timing[timing["method"] != TRUTH], "median_ns", lambda value: f"{significant(value)} ns"),
    }
    return {name: words["alt"] + values.get(name, "") for name, words in WORDS["plots"].items()}


def _fronts(table: pd.DataFrame, column: str) -> str:
    """Return the methods on a front, the cheapest first, in a sentence for each role."""
    sentences = []
    for role, group in parts_of(table, "role"):
        names = [display(row.method, row.setting) for row in rows(group[group[column].astype(bool)].sort_values("ns"))]
        if names:
            sentences.append(f" On the front, {role} fabrics: {listed(names)}.")
    return "".join(sentences)


def _by_role(table: pd.DataFrame, column: str, worded: Callable[[float], str], of: str = "") -> str:
    """Return the lowest and the highest value in a sentence for each role."""
    return "".join(_ends(group, column, worded, f"{of}, {role} fabrics") for role, group in parts_of(table, "role"))


def _ends(table: pd.DataFrame, column: str, worded: Callable[[float], str], where: str = "") -> str:
    """Return the lowest and the highest value of a column with their methods in a sentence; empty without values."""
    ordered = list(rows(table.dropna(subset=column).sort_values(column, kind="stable"))) if len(table) else []
    if not ordered:
        return ""
    ends = [f"{display(row.method, row.setting)} ({worded(getattr(row, column))})" for row in (ordered[0], ordered[-1])]
    return f" Lowest{where}: {ends[0]}; highest: {ends[1]}."
