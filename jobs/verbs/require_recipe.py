"""The recipe that `require` writes: one scene, its fabrics and distribution of queries, one method, a shorter training.

Of a general recipe it keeps the truth, the model's options, the training and the measurements, so that a page of either
says the same of the scene. Fewer fabrics in a narrower domain are learnt from fewer rows in fewer steps; how many is
the option `effort`. A truth that cannot answer the queries of the scene (`node_table` is limited to flat cloth) is
replaced by one that samples, at the error of `SAMPLED`.
"""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import tomli_w
from pydantic import BaseModel

from jobs.plan.plan import plan
from jobs.recipe.added import Added
from jobs.recipe.load import load_recipe
from jobs.recipe.recipe import ModelRecipe, Recipe
from jobs.recipe.validation import table_refusal
from pipeline.atomic import atomic_write
from pipeline.models.added.added_code import AddedMethod
from pipeline.scenes.requirement import Requirement
from pipeline.shards.queries import QueryOptions
from pipeline.truth.options import TruthOptions
from weaves.fabric import Fabric
from weaves.validation import validated

EFFORT: Final = 0.25
"""Share of the general recipe's training rows a fabric, and of its steps, that a scene's recipe takes."""

SAMPLED: Final = TruthOptions(relative_error=0.1, min_count=256, max_count=256)
"""Truth of training rows if the general recipe's estimator cannot answer: coarse, because training averages noise."""

_TEST_ROWS: Final = 4096
_FEWEST_ROWS: Final = 1024
_BASELINE: Final = "point_sampled"


def write_recipe(
    path: Path,
    requirement: Requirement,
    general: Recipe,
    method: str,
    setting: str,
    scene: str,
    fabrics: Mapping[str, tuple[str, Fabric]],
    effort: float = EFFORT,
    options: Mapping[str, Any] = MappingProxyType({}),
    add: Sequence[str] = (),
) -> None:
    """Write the recipe of one method in the scene's domain, and load it to check it.

    `general` has the method, truth and training, and was loaded with the methods `add` from outside; `setting` is empty
    for all settings of the method. A scene, and the reference beside each fabric by the fabric's name, is a name or a
    path from the current folder. `effort` is the share of the training rows a fabric and of the steps, > 0; `options`
    are those of the model that are other than in the general recipe. BadInput if the model has no such options, or the
    recipe cannot be used.
    """
    model = next(model for model in general.models if model.options.name == method)
    named = Added(add).model_of(model.options) if isinstance(model.options, AddedMethod) else model.options.model
    general = general.trainer_of(model)
    queries = requirement.queries(model.options.kinds)
    chosen = [k for k in model.options.settings if model.options.setting_of(k) == setting]
    worn = {name: fabrics[name] for name in requirement.fabrics}
    table: dict[str, Any] = {
        "name": f"require-{requirement.scene}",
        "about": f"What the scene {requirement.scene} requires, by {method}.",
        "dataset": {
            "seen": [_beside(path, reference) for reference, _ in worn.values()],
            "shard_rows": general.dataset.shard_rows,
            "seed": general.dataset.seed,
            "rows": _rows(general, effort if model.options.learns else 1.0),
            "queries": _stated(queries),
            **_truths(general, queries, [fabric for _, fabric in worn.values()]),
        },
        "models": [
            {"model": named} | _model(model, chosen, effort, _bent(model, queries) | dict(options)),
            *_baseline(general, method),
        ],
        "bench": _bench(general, set(worn), _beside(path, scene)),
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    atomic_write(path, tomli_w.dumps(table).encode())
    load_recipe(path, add)


def alone(general: Recipe, names: set[str]) -> Recipe:
    """Return a general recipe with some of its methods only, each with its first training."""
    return Recipe(**{**vars(general), "models": tuple(m.single[0] for m in general.models if m.options.name in names)})


def effort_of(recipe: Recipe) -> tuple[int, int]:
    """Return the rows that a recipe generates, and the queries of one training of each model, with repetitions."""
    rows = sum(task.rows for task in plan(recipe) if task.stage == "generate")
    learnt = 0
    for model in recipe.models:
        if model.options.learns:
            networks = len(recipe.seen + recipe.unseen) if model.options.of_one_material else 1
            learnt += networks * model.training.steps * model.training.batch
    return rows, learnt


def savings(path: Path, general: Recipe, add: Sequence[str] = ()) -> str:
    """Return a sentence: rows to generate and queries to train on, compared with the general recipe."""
    own = load_recipe(path, add)
    same = alone(general, {model.options.name for model in own.models})
    (rows, learnt), (rows_general, learnt_general) = effort_of(own), effort_of(same)
    generated = f"{rows:,} rows to generate in place of {rows_general:,} ({rows_general / rows:.1f} times fewer)"
    times = learnt_general / learnt if learnt else 0.0
    training = f"{learnt:,} queries to learn from in place of {learnt_general:,} ({times:.1f} times)"
    return f"Against {general.name} with this method alone: {generated}, {training if learnt else 'nothing to train'}."


def _rows(general: Recipe, effort: float) -> dict[str, int]:
    rows = general.dataset.rows
    train = min(rows.train, max(_FEWEST_ROWS, round(effort * rows.train)))
    return {"train": train, "validation": rows.validation, "test": min(rows.test, _TEST_ROWS)}


def _truths(general: Recipe, queries: QueryOptions, fabrics: list[Fabric]) -> dict[str, Any]:
    """Return how rows are answered: as in the general recipe, where its estimators know the queries."""
    truth, training = general.dataset.truth, general.dataset.training_truth
    tables: dict[str, Any] = {}
    sampled = truth.model_copy(update={"estimator": SAMPLED.estimator}), SAMPLED.model_copy(update=general.physics)
    for name, stated, other in zip(("truth", "training_truth"), (truth, training), sampled, strict=True):
        if stated is not None:
            refused = stated.estimator == "node_table" and table_refusal(stated, queries, fabrics)
            chosen = other if refused else stated
            tables[name] = chosen.model_dump(include={"estimator", "relative_error"}) | _stated(chosen)
    return tables


def _stated(options: BaseModel) -> dict[str, Any]:
    """Return the options other than the default, for TOML."""
    return options.model_dump(mode="json", exclude_defaults=True, exclude_none=True)


def _bent(model: ModelRecipe, queries: QueryOptions) -> dict[str, Any]:
    """Return the option for the largest curvature, if the model has it and the curvature of the scene exceeds it."""
    most = getattr(model.options, "largest_curvature", None)
    return {"largest_curvature": queries.curvature[1]} if most is not None and most < queries.curvature[1] else {}


def _baseline(general: Recipe, method: str) -> list[dict[str, Any]]:
    """Return point sampling with 2 points, the baseline, if the general recipe has it."""
    baselines = [model for model in general.models if model.options.name == _BASELINE != method]
    return [{"model": _BASELINE} | _model(model, [2], 1.0) for model in baselines]


def _model(
    model: ModelRecipe, settings: list[float], effort: float, other: Mapping[str, Any] = MappingProxyType({})
) -> dict[str, Any]:
    """Return a model's table without `model`, with the one setting in `settings`, if any, and a shortened training."""
    if isinstance(model.options, AddedMethod):
        options = {"name": model.options.name, "limit": model.options.limit} | model.options.own | dict(other)
    else:
        options = _stated(model.options) | dict(other)
        options["name"] = model.options.name
        validated(type(model.options), options, "--set")
        options.pop("model", None)
    if settings:
        options[model.options.parameter] = settings
    if model.options.learns:
        training = model.training
        average = round(training.average ** (1 / effort), 6)  # it spans the same share of the training
        shorter = {"steps": max(1, round(effort * training.steps)), "average": average}
        options["training"] = _stated(training) | shorter
    return options


def _bench(general: Recipe, worn: set[str], scene: str) -> dict[str, Any]:
    """Return the general recipe's measurements, of this scene, its fabrics and the method as it is."""
    live = general.bench.live
    live = live.model_copy(update={"fabrics": tuple(name for name in live.fabrics if name in worn)})
    measurements = _stated(general.bench.model_copy(update={"bounds": False, "runtimes": (), "live": live}))
    return measurements | {"scenes": measurements.get("scenes", {}) | {"names": [scene]}}


def _beside(path: Path, reference: str) -> str:
    """Return the reference to a fabric or scene in a recipe: a path relative to the recipe's folder, or a name."""
    if Path(reference).suffix not in (".toml", ".xml"):
        return reference
    return Path(os.path.relpath(Path(reference).resolve(), path.parent.resolve())).as_posix()
