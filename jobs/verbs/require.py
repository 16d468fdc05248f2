"""What a scene requires: its questions, the method that meets a wish, and a recipe for just that.

The choice is made from the Records of a page (`reports.tables.method_choice`); the recipe is a file like any other,
with the fabrics and the distribution of queries narrowed to the scene.
"""

from __future__ import annotations

import math
import time
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jobs.recipe.fallback_share import left_to_quadrature
from jobs.recipe.load import load_recipe
from jobs.recipe.recipe import ModelRecipe, Recipe
from jobs.verbs.compare import records_file
from jobs.verbs.require_recipe import EFFORT, savings, write_recipe
from weaves.errors import BadInput
from weaves.errors import nearest as nearest_name
from weaves.fabric import Fabric

if TYPE_CHECKING:
    from rich.table import Table

    from pipeline.scenes.requirement import Requirement
    from pipeline.truth.query import Queries
    from reports.options import SceneBenchOptions

_SAMPLE = 2000  # questions by which quadrature is timed
_JUDGED = 100  # questions a fabric by which its error is judged


def require(
    scene: str,
    out: Path,
    recipe: str,
    error: float,
    ms: float,
    frames: int,
    margin: float,
    method: str = "",
    effort: float = EFFORT,
    changes: Sequence[str] = (),
) -> None:
    """Print what a scene asks and which method meets the wish, and write its recipe.

    Parameters
    ----------
    scene : str
        Name of a scene of the package, or path of one.
    out : Path
        Folder of products that holds the page of `recipe`; the new recipe goes to its folder `recipes`.
    recipe : str
        General recipe, whose models are chosen from.
    error, ms : float
        Wish: largest relative RMSE of the colour, longest milliseconds a frame; infinite if there is none.
    frames : int
        Frames that are looked at, spread over the camera's way.
    margin : float
        By how much ranges are widened (`Requirement.of`).
    method : str
        Wish: a method of the general recipe; the front's own choice if empty.
    effort : float
        Share of the general recipe's rows a fabric and of its steps that a training takes.
    changes : sequence of str
        Options of the model that are other than there, each as ``key = value`` in TOML.

    Raises
    ------
    BadInput
        If the scene cannot be used, the page has no errors by size, or nothing meets the wish: then the nearest points
        of the front are named.
    """
    from rich.console import Console

    from reports.record import read_records
    from reports.tables.equal_time import size_table
    from reports.tables.method_choice import cheapest, nearest, of_method, predictions, with_measured
    from reports.tables.summary import rows, scene_table

    for key, value, allowed in (
        ("error", error, "> 0"),
        ("time", ms, "> 0"),
        ("frames", frames, ">= 1"),
        ("margin", margin, ">= 1"),
        ("effort", effort, "> 0"),
    ):
        if not (value > 0 if allowed == "> 0" else value >= 1):
            raise BadInput("require", f"--{key}", value, f"must be {allowed}")
    general = load_recipe(recipe)
    options = _options(changes)
    names = [model.options.name for model in general.models]
    if method and method not in names:
        raise BadInput(
            "require", "--method", method, f"{general.name} has no such method; {nearest_name(method, names, 'model')}"
        )
    records = read_records([records_file(out, general.name)])
    sizes = size_table(records)
    if sizes.empty:
        raise BadInput(str(out), "recipe", recipe, "its page has no errors by the size of footprints; run it again")
    asked, worn = _questions(scene, frames, general.bench.scenes)
    fabrics = {name: fabric for name, (_, fabric) in worn.items()}
    requirement = _requirement(scene, asked, frames, margin)
    left = {model.options.name: _left(model, asked, fabrics, general) for model in general.models}
    quadrature = _quadrature(asked, fabrics)
    shares = {name: share for name, share in left.items() if share is not None}
    table = predictions(sizes, requirement.sizes, requirement.questions, shares, quadrature)
    table = with_measured(table, scene_table(records), requirement.scene)
    console = Console()
    console.print(_asked_table(requirement), "")
    console.print(_choice_table(rows(table)), "")
    if method and (table := of_method(table, method)).empty:
        allowed = "it was not measured on footprints of these sizes, or does not know the scene's fabrics"
        raise BadInput("require", "--method", method, allowed)
    chosen = cheapest(table, error, ms)
    if chosen is None:
        near = "; ".join(
            f"{row.method} {row.setting}".strip() + f": {100 * row.error:.2g} % in {row.ms:.3g} ms"
            for row in rows(nearest(table, error, ms))
        )
        wish = f"{100 * error:g} % in {ms:g} ms a frame"
        raise BadInput("require", "wish", wish, f"no method meets it; the nearest points of the front are {near}")
    path = out / "recipes" / f"require-{requirement.scene}.toml"
    write_recipe(path, requirement, general, chosen.method, chosen.setting, scene, worn, effort, options)
    name = f"{chosen.method} {chosen.setting}".strip()
    console.print(
        f"{name}: {100 * chosen.error:.2g} % in {chosen.ms:.3g} ms a frame ({chosen.known}). {savings(path, general)}",
        f"the recipe: {path}", sep="\n", soft_wrap=True, highlight=False,
    )  # fmt: skip


def _questions(
    scene: str, frames: int, options: SceneBenchOptions
) -> tuple[dict[str, Queries], dict[str, tuple[str, Fabric]]]:
    """Return all questions of some frames about each fabric, by its name; and what names each fabric, and itself."""
    import numpy as np

    from pipeline.scenes.catalogue import load_scene
    from pipeline.scenes.frame import render
    from pipeline.scenes.loading import load
    from pipeline.truth.query import Queries

    described = load_scene(scene)
    loaded = load(described, options.options)
    found: dict[str, list[Queries]] = {}
    fabrics = {}
    for index in np.linspace(0, max(described.frames - 1, 0), frames):
        for key, gbuffer in render(loaded, float(index), options.size).gbuffers.items():
            cloth, fabric = loaded.cloths[key]
            fabrics[fabric.name] = (cloth.fabric or key, fabric)
            found.setdefault(fabric.name, []).append(gbuffer.queries(fabric.weave.repeat))
    return {
        name: Queries(*(np.concatenate([getattr(part, column) for part in parts]) for column in Queries._fields))
        for name, parts in found.items()
    }, fabrics


def _requirement(scene: str, asked: Mapping[str, Queries], frames: int, margin: float) -> Requirement:
    from pipeline.scenes.catalogue import load_scene
    from pipeline.scenes.requirement import Requirement
    from reports.measure.by_size import EDGES, SIZES

    return Requirement.of(load_scene(scene).name, frames, asked, EDGES[:-1], SIZES, margin)


def _options(changes: Iterable[str]) -> dict[str, Any]:
    """Return options from ``key = value`` in TOML."""
    found: dict[str, Any] = {}
    for change in changes:
        try:
            found |= tomllib.loads(change)
        except ValueError as error:
            raise BadInput("require", "--set", change, "must be KEY=VALUE as in TOML, such as hidden=64") from error
    return found


def _left(
    model: ModelRecipe, asked: Mapping[str, Queries], fabrics: Mapping[str, Fabric], general: Recipe
) -> float | None:
    """Return the share of questions that a model leaves to quadrature; None if it cannot answer for the fabrics."""
    teacher = general.teacher_of(model)
    if model.of_one_material and not set(fabrics) <= {fabric.name for fabric in teacher.seen + teacher.unseen}:
        return None
    return left_to_quadrature(model, general, [(fabrics[name], queries) for name, queries in asked.items()])


def _quadrature(asked: Mapping[str, Queries], fabrics: Mapping[str, Fabric]) -> tuple[float, float]:
    """Return what quadrature errs (as the colour measure of the benchmark) and its nanoseconds a question.

    It is asked what it will mostly be asked: with light or viewer behind, where a scene has that.
    """
    import numpy as np

    from pipeline.models.fallback import fallback
    from pipeline.truth.estimator import estimate
    from pipeline.truth.options import TruthOptions
    from reports.error import COLOUR_WEIGHTS

    some = any(queries.behind.any() for queries in asked.values())
    wrong, colours, seconds, count = [], [], 0.0, 0
    for name, queries in asked.items():
        rows = np.flatnonzero(queries.behind) if some else np.arange(len(queries.u))
        rows = np.random.default_rng(0).permutation(rows)[: _SAMPLE // len(asked)]
        if not rows.size:
            continue
        fallback(fabrics[name], queries.take(rows[:2]), 0)  # tables
        start = time.perf_counter()
        answers = fallback(fabrics[name], queries.take(rows), 0)
        seconds, count = seconds + time.perf_counter() - start, count + rows.size
        truth = estimate(fabrics[name], queries.take(rows[:_JUDGED]), TruthOptions(estimator="auto"), 1).mean
        colour = truth @ COLOUR_WEIGHTS
        wrong.append(answers[:_JUDGED] @ COLOUR_WEIGHTS - colour)
        colours.append(colour)
    error, mean = math.sqrt(np.mean(np.square(np.concatenate(wrong)))), float(np.mean(np.concatenate(colours)))
    return error / max(mean, 1e-9), 1e9 * seconds / count


def _asked_table(requirement: Requirement) -> Table:
    """Show what the scene asks."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False, show_header=False, padding=(0, 2, 0, 0))
    fabrics = ", ".join(f"{name} {100 * share:.0f} %" for name, share in requirement.fabrics.items())
    sizes = ", ".join(f"{name} {100 * share:.0f} %" for name, share in requirement.sizes.items() if share > 0)
    curved = (
        "none"
        if not requirement.curved
        else (
            f"{100 * requirement.curved:.0f} %, {requirement.curvature[0]:.2g} to {requirement.curvature[1]:.2g} a yarn"
        )
    )
    for name, text in (
        (
            "scene",
            f"{requirement.scene}, {requirement.questions:,} questions a frame",
        ),
        ("fabrics", fabrics),
        (
            "footprints",
            f"{requirement.sigma[0]:.2g} to {requirement.sigma[1]:.3g} yarns, axes up to {requirement.stretch:.2g} : 1",
        ),
        ("their sizes", sizes),
        ("angles", f"light up to {requirement.angle[0]:.1f}°, viewer up to {requirement.angle[1]:.1f}°"),
        ("curved cloth", curved),
        ("light from behind", f"{100 * requirement.behind:.1f} %"),
        ("back of the cloth", f"{100 * requirement.viewer_behind:.1f} %"),
    ):
        table.add_row(name, text)
    return table


def _choice_table(found: Iterable[Any]) -> Table:
    """Show the methods, the fastest first; those on the front in bold."""
    from rich.table import Table

    from reports.tables.number_format import display

    table = Table(box=None, pad_edge=False, header_style="bold", padding=(0, 2, 0, 0))
    for name in ("method", "error", "ms a frame", "not its own", ""):
        table.add_column(name, justify="left" if name in ("method", "") else "right")
    for row in found:
        error = f"{100 * row.error:.2g} %" if row.error > 0 else "in the noise"
        cells = [error, f"{row.ms:,.3g}", f"{100 * row.fallback:.0f} %", row.known]
        table.add_row(display(row.method, row.setting), *cells, style="bold" if row.front else "")
    return table
