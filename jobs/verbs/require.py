"""`twillight require`: requirements of a scene, the method that meets a limit, and its recipe.

The method is chosen from the Records of a page (`reports.tables.method_choice`). The recipe is an ordinary file, with
the fabrics and the distribution of queries narrowed to the scene.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from cyclopts import Parameter

from jobs.plan.task import STAGES
from jobs.recipe.fallback_share import fallback_share
from jobs.recipe.load import load_recipe
from jobs.recipe.recipe import ModelRecipe, Recipe
from jobs.terminal import print_lines, print_table
from jobs.verbs.parameters import NOTHING, ON, OUT, Add, Out, SceneName, Whole
from jobs.verbs.records import records_file
from jobs.verbs.require_recipe import EFFORT, savings, write_recipe
from jobs.verbs.run import work
from pipeline.scenes.catalogue import load_scene
from pipeline.scenes.requirement import Requirement
from pipeline.truth.query import Queries
from weaves.errors import BadInput, nearest
from weaves.fabric import Fabric
from weaves.reading import MOST_TEXT
from weaves.validation import parse_toml

if TYPE_CHECKING:
    from pipeline.scenes.scene import Scene
    from reports.options import SceneBenchOptions

_SAMPLE = 2000  # queries for the time of the fallback
_JUDGED = 100  # queries per fabric for its error
_MOST_FRAMES = 10_000


def require(
    scene: SceneName,
    *,
    error: Annotated[float, Parameter(help="Largest relative RMSE of the colour; .05 is 5 %.")] = float("inf"),
    time: Annotated[float, Parameter(help="Longest time of a frame on one thread, in milliseconds.")] = float("inf"),
    recipe: Annotated[str, Parameter(help="General recipe with a finished page.")] = "quick",
    frames: Annotated[Whole, Parameter(help="Frames of the camera path that are analysed.")] = 4,
    margin: Annotated[float, Parameter(help="Factor by which the ranges of queries are widened.")] = 1.25,
    method: Annotated[str, Parameter(help="Method of the general recipe; default: the cheapest.")] = "",
    effort: Annotated[float, Parameter(help="Share of its rows per fabric and of its training steps.")] = EFFORT,
    set_: Annotated[
        list[str], Parameter(name="--set", help="Changed option of the method, such as hidden=64.")
    ] = NOTHING,
    run: Annotated[bool, Parameter(negative="", help="Run the general recipe first; what is done is skipped.")] = False,
    add: Add = NOTHING,
    out: Out = OUT,
) -> None:
    """Print the requirements of a scene and the methods that meet a limit, and write the recipe of the chosen one.

    BadInput if the scene cannot be used, the page has no errors by size, its best method is none of the recipe's, or no
    method meets the limits. Then the sentence names the nearest points of the front.
    """
    from reports.measure.by_size import EDGES, SIZES
    from reports.record import read_records
    from reports.tables import equal_time, method_choice, number_format, tradeoff
    from reports.tables.summary import rows, scene_table

    _refuse_limits(error=error, time=time, frames=frames, margin=margin, effort=effort)
    general = load_recipe(recipe, add)
    options = _options(set_)
    names = [model.options.name for model in general.models]
    if method and method not in names:
        raise BadInput("require", "--method", method, f"{general.name} has no such method; {nearest(method, names)}")
    described = load_scene(scene)
    if run:
        work(recipe, STAGES, out, ON, add)
    try:
        page = records_file(out, general.name)
    except BadInput as missing:
        first = f"`twillight run {recipe}` must run first, or --run here; `twillight plan {recipe}` says how long"
        raise BadInput(missing.where, missing.key, missing.value, first) from missing
    records = read_records([page])
    sizes = equal_time.size_table(records)
    if sizes.empty:
        raise BadInput(str(out), "recipe", recipe, "its page has no errors by size of footprint; run the recipe again")
    queries_by_fabric, worn = _queries_of(described, frames, general.bench.scenes)
    requirement = Requirement.of(described.name, frames, queries_by_fabric, EDGES[:-1], SIZES, margin)
    by_fabric = [(worn[name][1], queries) for name, queries in queries_by_fabric.items()]
    every_share = {model.options.name: _fallback_share(model, by_fabric, general) for model in general.models}
    shares = {name: share for name, share in every_share.items() if share is not None}
    costs = requirement.queries_per_frame, shares, _fallback_cost(by_fabric)
    table = method_choice.predictions(sizes, requirement.sizes, *costs)
    table = method_choice.with_measured(table, scene_table(records), requirement.scene)
    _print_requirement(requirement)
    cells = []
    for row in rows(table):
        of_truth = f"{100 * row.error:.2g} %" if row.error > 0 else "in the noise"
        name = number_format.display(row.method, row.setting)
        cells.append((name, of_truth, f"{row.ms:,.3g}", f"{100 * row.fallback:.0f} %", row.known))
    front = {index: "bold" for index, row in enumerate(rows(table)) if row.front}
    print_table(("method", "error", "ms per frame", "fallback share", ""), cells, text=("",), styles=front)
    print_lines("")
    if method and (table := method_choice.of_method(table, method)).empty:
        allowed = "it was not measured on footprints of these sizes, or does not cover the fabrics of the scene"
        raise BadInput("require", "--method", method, allowed)
    chosen = tradeoff.cheapest(table, "error" if math.isinf(error) else "ms", error=error, ms=time)
    if chosen is None:
        near = "; ".join(
            f"{row.method} {row.setting}".strip() + f": {100 * row.error:.2g} % in {row.ms:.3g} ms"
            for row in rows(method_choice.nearest(table, error, time))
        )
        limits = f"{100 * error:g} % in {time:g} ms per frame"
        raise BadInput("require", "limits", limits, f"no method meets them; the nearest points of the front are {near}")
    if chosen.method not in names:
        allowed = "the page shows it, the recipe has no such method: run the recipe again, or choose one with --method"
        where, known = f"the page of {general.name}", nearest(chosen.method, names)
        raise BadInput(where, "method", chosen.method, f"{allowed}; {known}")
    path = out / "recipes" / f"require-{requirement.scene}.toml"
    write_recipe(path, requirement, general, chosen.method, chosen.setting, scene, worn, effort, options, add)
    name = f"{chosen.method} {chosen.setting}".strip()
    cost = f"{100 * chosen.error:.2g} % in {chosen.ms:.3g} ms per frame ({chosen.known})"
    print_lines(f"{name}: {cost}. {savings(path, general, add)}", f"recipe: {path}")


def _refuse_limits(**limits: float) -> None:
    """Refuse a number that is too small, and too many frames: frames and margin from 1 on, others above 0."""
    if limits["frames"] > _MOST_FRAMES:
        raise BadInput("require", "--frames", limits["frames"], f"at most {_MOST_FRAMES:,} frames can be analysed")
    for key, value in limits.items():
        least = 1 if key in ("frames", "margin") else 0
        if not (value >= least and value > 0):
            raise BadInput("require", f"--{key}", value, f"must be {'>= 1' if least else '> 0'}")


def _queries_of(
    scene: Scene, frames: int, options: SceneBenchOptions
) -> tuple[dict[str, Queries], dict[str, tuple[str, Fabric]]]:
    """Return the queries of some frames on each fabric, and each fabric with its reference (name or path), by name."""
    from pipeline.scenes.frame import render
    from pipeline.scenes.loading import load

    loaded = load(scene, options.options)
    parts: dict[str, list[Queries]] = {}
    fabrics = {}
    for index in np.linspace(0, max(scene.frames - 1, 0), frames):
        for key, gbuffer in render(loaded, float(index), options.size).gbuffers.items():
            cloth, fabric = loaded.cloths[key]
            fabrics[fabric.name] = (cloth.fabric or key, fabric)
            parts.setdefault(fabric.name, []).append(gbuffer.queries(fabric.repeat))
    return {name: Queries(*map(np.concatenate, zip(*of, strict=True))) for name, of in parts.items()}, fabrics


def _options(changes: Iterable[str]) -> dict[str, Any]:
    """Return options from ``key = value`` in TOML."""
    options: dict[str, Any] = {}
    for change in changes:
        try:
            options |= parse_toml(change[:MOST_TEXT], "require")
        except BadInput as error:
            raise BadInput("require", "--set", change, "must be KEY=VALUE as in TOML, such as hidden=64") from error
    return options


def _fallback_share(model: ModelRecipe, by_fabric: Iterable[tuple[Fabric, Queries]], general: Recipe) -> float | None:
    """Return the fallback share of a model; None if it does not cover the fabrics."""
    trainer = general.trainer_of(model)
    known = {fabric.name for fabric in trainer.seen + trainer.unseen}
    if model.options.of_one_material and not known.issuperset(fabric.name for fabric, _ in by_fabric):
        return None
    return fallback_share(model, general, by_fabric)


def _fallback_cost(by_fabric: Sequence[tuple[Fabric, Queries]]) -> tuple[float, float]:
    """Return the relative RMSE of the fallback (colour measure of the benchmark) and its nanoseconds per query."""
    from pipeline.models.fallback import fallback_answers
    from pipeline.truth.estimator import estimate
    from pipeline.truth.options import TruthOptions
    from reports.error import COLOUR_WEIGHTS

    # Queries with light or viewer behind, if there are any, fall back most often.
    behind = any(queries.behind.any() for _, queries in by_fabric)
    differences, colours, seconds, count = [], [], 0.0, 0
    for fabric, queries in by_fabric:
        rows = np.flatnonzero(queries.behind) if behind else np.arange(len(queries.u))
        rows = np.random.default_rng(0).permutation(rows)[: _SAMPLE // len(by_fabric)]
        if not rows.size:
            continue
        fallback_answers(fabric, queries.take(rows[:2]), 0)  # builds the tables
        start = perf_counter()
        answers = fallback_answers(fabric, queries.take(rows), 0)
        seconds, count = seconds + perf_counter() - start, count + rows.size
        colour = estimate(fabric, queries.take(rows[:_JUDGED]), TruthOptions(estimator="auto"), 1).mean @ COLOUR_WEIGHTS
        differences.append(answers[:_JUDGED] @ COLOUR_WEIGHTS - colour)
        colours.append(colour)
    error, mean = math.sqrt(np.mean(np.square(np.concatenate(differences)))), float(np.mean(np.concatenate(colours)))
    return error / max(mean, 1e-9), 1e9 * seconds / count


def _print_requirement(of: Requirement) -> None:
    low, high = of.curvature
    curved = f"{100 * of.curved:.0f} %, {low:.2g} to {high:.2g} a yarn" if of.curved else "none"
    rows = (
        ("fabrics", _shares(of.fabrics)),
        ("footprints", f"{of.sigma[0]:.2g} to {of.sigma[1]:.3g} yarns, axes up to {of.stretch:.2g} : 1"),
        ("their sizes", _shares({name: share for name, share in of.sizes.items() if share > 0})),
        ("angles", f"light up to {of.angle[0]:.1f}°, viewer up to {of.angle[1]:.1f}°"),
        ("curved cloth", curved),
        ("light from behind", f"{100 * of.behind:.1f} %"),
        ("back of the cloth", f"{100 * of.viewer_behind:.1f} %"),
    )
    heading = f"{of.scene}, {of.queries_per_frame:,} queries per frame"
    print_table(("scene", heading), rows, text=(heading,))
    print_lines("")


def _shares(of: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {100 * share:.0f} %" for name, share in of.items())
