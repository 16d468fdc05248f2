"""A recipe for one scene: its fabrics, its distribution of queries, one method.

Of a general recipe it keeps the rows of a fabric, the truth, the model's options and the training, whose steps shrink
with the number of fabrics, to `LEAST_STEPS` of them at least.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

from jobs.plan import plan
from jobs.recipe import Recipe, load_recipe
from pipeline.atomic import atomic_write
from pipeline.scenes.requirement import Requirement
from pipeline.shards.queries import QueryOptions

LEAST_STEPS: Final = 0.2
"""Share of the general training that a narrower one still takes."""

_TEST_ROWS = 4096


def write_recipe(path: Path, requirement: Requirement, general: Recipe, method: str, setting: str) -> None:
    """Write the recipe of one method in the scene's domain, and read it back: it must be one."""
    (model,) = (model for model in general.models if model.options.name == method)
    general = general.teacher_of(model)
    options = model.options.model_dump(mode="json", exclude_defaults=True) | {
        "model": model.options.model,
        "name": method,
    }
    if setting.startswith("k = "):
        knob = next(key for key in ("counts", "nodes") if hasattr(model.options, key))
        options[knob] = [int(setting.removeprefix("k = "))]
    queries = requirement.queries(model.options.kinds)
    unlike = {name: value for name, value in queries.model_dump(mode="json").items() if value != _default(name)}
    share = len(requirement.fabrics) / len(general.seen + general.population)
    lines = [
        f"name = {_toml(f'require-{requirement.scene}')}",
        f"about = {_toml(f'What the scene {requirement.scene} requires, by {method}.')}",
        "",
        "[dataset]",
        f"seen = {_toml([*requirement.fabrics])}",
        f"shard_rows = {general.dataset.shard_rows}",
        f"seed = {general.dataset.seed + 1}",
        "",
        "[dataset.rows]",
        f"train = {general.dataset.rows.train}",
        f"validation = {general.dataset.rows.validation}",
        f"test = {_TEST_ROWS}",
        "",
        "[dataset.queries]",
        *(f"{name} = {_toml(value)}" for name, value in unlike.items()),
        "",
        "[dataset.truth]",
        f"relative_error = {general.dataset.truth.relative_error}",
        "",
        "[[models]]",
        *(f"{name} = {_toml(value)}" for name, value in options.items()),
    ]
    if model.learns:
        training = model.training.model_dump(mode="json", exclude_defaults=True)
        training["steps"] = max(1, round(model.training.steps * max(share, LEAST_STEPS)))
        lines += ["[models.training]", *(f"{name} = {_toml(value)}" for name, value in training.items())]
    lines += ["", "[[models]]", 'model = "point_sampled"', "counts = [2]"] if method != "point_sampled" else []
    lines += ["", "[bench.scenes]", f"names = {_toml([requirement.scene])}", ""]
    path.parent.mkdir(parents=True, exist_ok=True)
    atomic_write(path, "\n".join(lines).encode())
    load_recipe(path)


def savings(path: Path, general: Recipe) -> str:
    """Say what the recipe saves against the general one: rows to generate, queries to learn from."""

    def effort(recipe: Recipe) -> tuple[int, int]:
        rows = sum(task.rows for task in plan(recipe) if task.stage == "generate")
        learnt = sum(
            model.training.steps * model.training.batch * (len(recipe.seen) if model.of_one_material else 1)
            for model in recipe.models
            if model.learns
        )
        return rows, learnt

    own = load_recipe(path)
    names = {model.options.name for model in own.models}
    same = Recipe(**{**vars(general), "models": tuple(m for m in general.models if m.options.name in names)})
    (rows, learnt), (rows_general, learnt_general) = effort(own), effort(same)
    said = f"{rows:,} rows to generate in place of {rows_general:,} ({rows_general / rows:.1f} times fewer)"
    if learnt:
        said += (
            f", {learnt:,} queries to learn from in place of {learnt_general:,} ({learnt_general / learnt:.1f} times)"
        )
    return f"Against {general.name} with this method alone: {said}{'' if learnt else ', nothing to train'}."


def _default(name: str) -> Any:
    return QueryOptions().model_dump(mode="json")[name]


def _toml(value: Any) -> str:
    """Return a value as TOML: JSON's numbers, strings and lists are TOML's."""
    return json.dumps(value)
