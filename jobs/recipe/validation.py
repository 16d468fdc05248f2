"""Validation across the sections of a recipe: each may be valid by itself and not fit the others."""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Final, get_args

import numpy as np

from jobs.recipe.recipe import Recipe
from pipeline.models.domain import PHYSICS
from pipeline.shader.limits import MOST_REPEAT_CELLS
from pipeline.shards.angular_samples import AngularSamples
from pipeline.shards.queries import QueryOptions
from pipeline.truth.options import (
    FEWEST_NODES,
    NARROWEST_RIMS,
    RAYS_RESOLVED,
    TABLE_CELLS,
    TABLE_SIGMA,
    TruthOptions,
    seen_distance,
    steepness,
)
from pipeline.truth.query import LOWEST_VIEWER
from weaves.errors import BadInput, nearest
from weaves.fabric import Fabric

_TAKEN = ("truth", "bench", "fallback")  # beside names of models, in Records and among the versions of a task
_MOST_SHARDS: Final = 250_000  # each a task: 2 * 10^9 rows by default; the manifest then has 60 MB
_PLAIN = TruthOptions()
# Physics that not every model can learn. A model without an option for walls is measured against any.
_LEARNT = ("frame", "normaliser", "parallax", "shadows")


def validate_recipe(recipe: Recipe, where: str) -> None:
    """Check that the sections of a recipe fit together, so that no task is refused in the middle of a run.

    BadInput for more than 250,000 shards, names given twice, an unseen draft in the population (also of random
    unseen fabrics, unless a seen fabric has it), different physics in two tables of truth options, viewers too low for
    parallax, models that do not know the queries or the physics of the data set, the estimator `node_table` for cloth
    or queries that it does not know, and live pages of fabrics that it has not.
    """
    _check_number(recipe, where)
    _check_names(recipe, where)
    _check_population(recipe, where)
    _check_models(recipe, where)
    _check_truths(recipe, where)
    _check_live(recipe, where)


def table_refusal(truth: TruthOptions, queries: QueryOptions, fabrics: Sequence[Fabric]) -> str:
    """Return why the estimator `node_table` cannot answer all queries of a distribution; empty if it can.

    `node_table` answers from its nodes or not at all, so that tests and timings know what they compare. `auto` takes
    the same table where it is good enough and samples the rest; with a large `relative_error` it costs the same.
    """
    if any(getattr(truth, name) != getattr(_PLAIN, name) for name in ("frame", "shadows")):
        return "it knows the default frame and shadows only"
    if queries.sigma[0] < TABLE_SIGMA:
        return f"it knows footprints from {TABLE_SIGMA:.3g} yarn spacings on, the queries begin at {queries.sigma[0]:g}"
    if truth.parallax and truth.footprint != "gaussian":
        return "with parallax it knows Gaussian footprints only"
    if queries.stretch > 1.0 or queries.curvature[1] > 0.0:
        return "it knows round footprints of flat cloth only"
    for fabric in fabrics:
        if truth.parallax and queries.sigma[0] < (least := _ray_sigma(truth, fabric, queries.max_angle)):
            allowed = f"with parallax it knows footprints from {least:.2g} yarn spacings on for views of {fabric.name}"
            return f"{allowed} to {queries.max_angle:g} degrees, the queries begin at {queries.sigma[0]:g}"
        radius = 0.5 * min(fabric.warp.width, fabric.weft.width)
        if truth.walls == "rim" and radius < NARROWEST_RIMS:
            return f"it knows rims of yarns at least {2 * NARROWEST_RIMS:g} wide, {fabric.name} has {2 * radius:g}"
        ends, picks = fabric.weave.repeat
        if ends * picks > TABLE_CELLS and (cells := fabric.weave.different_cells()) > TABLE_CELLS:
            return f"it knows at most {TABLE_CELLS} different cells, {fabric.name} has {cells}"
    return ""


def _ray_sigma(truth: TruthOptions, fabric: Fabric, degrees: float) -> float:
    """Return the smallest deviation of footprints of view rays that `node_table` knows for any view up to an angle."""
    steepest = max(steepness(yarn.relief, yarn.width, math.radians(yarn.bend)) for yarn in (fabric.warp, fabric.weft))
    cosine = np.array([math.cos(math.radians(degrees))])
    return RAYS_RESOLVED[truth.walls] * float(seen_distance(steepest, cosine, FEWEST_NODES)[0])


def _check_number(recipe: Recipe, where: str) -> None:
    most, shards = recipe.dataset.shard_rows, 0
    for _, fabric, part, rows in (*recipe.own_rows(), *recipe.extra_rows()):
        shards += -(-rows // most)
        if shards > _MOST_SHARDS:
            name = part if isinstance(part, str) else part.kind
            passed = f"passed with {rows:,} rows ({name}) of {fabric.name}: raise it, or lower the rows"
            raise BadInput(where, "dataset.shard_rows", most, f"at most {_MOST_SHARDS:,} shards are allowed, {passed}")


def _check_names(recipe: Recipe, where: str) -> None:
    models = [model.options.name for model in recipe.models]
    for key, names in {"dataset": [fabric.name for fabric in recipe.fabrics], "models": models}.items():
        for name, count in Counter(names).items():
            if count > 1:
                raise BadInput(where, key, name, "names must differ, because files are called by them")
    for index, name in enumerate(models):
        if name in _TAKEN:
            allowed = f"must be another name: {', '.join(_TAKEN)} name other things than models"
            raise BadInput(where, f"models.{index}.name", name, allowed)


def _check_population(recipe: Recipe, where: str) -> None:
    if recipe.population and not recipe.dataset.rows.population:
        raise BadInput(where, "dataset.rows.population", 0, "must be > 0 when dataset.population.count is")
    # Where a seen fabric has the same draft, only the yarns are unseen.
    seen = {fabric.weave.canonical() for fabric in recipe.seen}
    unseen = {fabric.weave.canonical(): fabric for fabric in recipe.unseen if fabric.weave.canonical() not in seen}
    random = {fabric.weave.canonical(): fabric for fabric in recipe.unseen_population}
    for member in recipe.population:
        draft = member.weave.canonical()
        if fabric := unseen.get(draft):
            allowed = f"must name {fabric.weave.name!r}, else the draft of {fabric.name} is seen in training"
            raise BadInput(where, "dataset.population.exclude", list(recipe.dataset.population.exclude), allowed)
        if draft not in seen and (fabric := random.get(draft)):
            exclude = list(recipe.dataset.unseen_population.exclude)
            allowed = f"must name the draft of {fabric.name}, which {member.name} is trained on ({fabric.source})"
            raise BadInput(where, "dataset.unseen_population.exclude", exclude, allowed)


def _check_live(recipe: Recipe, where: str) -> None:
    measured = {fabric.name: fabric for fabric in (*recipe.seen, *recipe.unseen)}
    for name in recipe.bench.live.fabrics:
        if name not in measured:
            allowed = f"must be a seen or unseen fabric of the recipe; {nearest(name, measured)}"
            raise BadInput(where, "bench.live.fabrics", name, allowed)
        ends, picks = measured[name].weave.repeat
        if ends * picks > MOST_REPEAT_CELLS:
            allowed = f"its repeat has {ends * picks:,} cells, a live page takes at most {MOST_REPEAT_CELLS:,}"
            raise BadInput(where, "bench.live.fabrics", name, allowed)


def _check_truths(recipe: Recipe, where: str) -> None:
    """Refuse rows, samples and pictures of another physics than that of `dataset.truth`, or that no table answers."""
    plain = recipe.dataset.truth
    for key, truth, queries, fabrics in _truths(recipe):
        for name in PHYSICS:
            if (value := getattr(truth, name)) != getattr(plain, name):
                allowed = f"must be that of dataset.truth, {getattr(plain, name)!r}"
                raise BadInput(where, f"{key}.{name}", value, allowed)
        if truth.parallax and queries and math.cos(math.radians(queries.max_angle)) < LOWEST_VIEWER:
            allowed = f"needs viewers within 89 degrees of the normal, max_angle is {queries.max_angle:g}"
            raise BadInput(where, f"{key}.parallax", True, allowed)
        if truth.estimator == "node_table":
            reason = "footprints of pictures are not known before"
            if queries is None or (reason := table_refusal(truth, queries, fabrics)):
                raise BadInput(where, f"{key}.estimator", "node_table", f"{reason}; take 'auto'")


def _truths(recipe: Recipe) -> Iterator[tuple[str, TruthOptions, QueryOptions | None, Sequence[Fabric]]]:
    """Yield each table of truth options: its key, itself, the queries if they are known, the fabrics."""
    dataset, bench = recipe.dataset, recipe.bench
    named, trained = (*recipe.seen, *recipe.unseen), (*recipe.seen, *recipe.population)
    if any("unseen" in model.trained_roles for model in recipe.own_models):
        trained += recipe.unseen
    tested = (*named, *recipe.unseen_population)
    yield "dataset.truth", dataset.truth, dataset.queries, tested if dataset.training_truth else (*tested, *trained)
    if dataset.training_truth:
        yield "dataset.training_truth", dataset.training_truth, dataset.queries, trained
    for index, model in enumerate(recipe.models):
        for rows in model.options.extra_rows:
            if isinstance(rows, AngularSamples):
                # A general model computes the samples of unseen fabrics as well.
                yield f"models.{index}.truth", rows.truth, rows.queries, recipe.fabrics
    yield "bench.truth", bench.truth, None, named
    yield "bench.frame_truth", bench.frame_truth, None, named
    if dataset.queries.curvature[1] > 0:
        yield "bench.edge.truth", bench.edge.truth, None, named
    if bench.scenes.names:
        yield "bench.scenes.truth", bench.scenes.truth, None, named
        yield "bench.scenes.frame_truth", bench.scenes.frame_truth, None, named


def _check_models(recipe: Recipe, where: str) -> None:
    queries, truth = recipe.dataset.queries, recipe.dataset.truth
    kinds = {"behind": queries.behind > 0, "stretch": queries.stretch > 1, "curvature": queries.curvature[1] > 0}
    if recipe.bench.bounds and kinds["curvature"]:
        raise BadInput(where, "bench.bounds", True, "the bound does not know queries with curvature")
    if recipe.bench.bounds and not truth.parallax:
        allowed = "the bound knows view rays alone, not dataset.truth.parallax = false"
        raise BadInput(where, "bench.bounds", True, allowed)
    for index, model in enumerate(recipe.models):
        options = model.options
        for kind in (kind for kind, drawn in kinds.items() if drawn and kind not in options.kinds):
            allowed = f"does not know queries with {kind}: leave it out, or dataset.queries.{kind}"
            raise BadInput(where, f"models.{index}.name", options.name, allowed)
        for name in () if options.any_physics else (name for name in _LEARNT if not hasattr(options, name)):
            if (value := getattr(truth, name)) != (own := getattr(_PLAIN, name)):
                raise _only_known(where, index, options.name, name, own, value)
        for name in ("footprint", "parallax", "walls"):
            wanted = getattr(truth, name)
            if (own := getattr(options, name, wanted)) != wanted:
                if get_args(type(options).model_fields[name].annotation) == (own,):
                    raise _only_known(where, index, options.name, name, own, wanted)
                raise BadInput(where, f"models.{index}.{name}", own, f"must be that of dataset.truth, {wanted!r}")
        largest = getattr(options, "largest_curvature", queries.curvature[1])
        if largest < queries.curvature[1]:
            allowed = f"must not be below that of dataset.queries.curvature, {queries.curvature[1]:g}"
            raise BadInput(where, f"models.{index}.largest_curvature", largest, allowed)


def _only_known(where: str, index: int, model: str, name: str, own: object, value: object) -> BadInput:
    return BadInput(where, f"dataset.truth.{name}", value, f"{model} (models.{index}) knows {name} = {own!r} only")
