"""Models that another recipe trains: ``[[models]] model = "curved", recipe = "trade_curved"``.

A data set has one distribution of queries, and some models must be taught another: light from behind, curved cloth. The
other recipe then says everything about the model, its options, its training and the rows that it reads; the tasks are
those of that recipe, and so are the products. This recipe measures the result beside its own models.

A model of many fabrics must have been trained on every fabric that is seen here, never on a draft that is unseen here,
and on yarns like those of all: what the page says of seen and unseen fabrics holds for it too. A model of one material
is measured on the fabrics it was trained on, and left out on the others.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from jobs.recipe.recipe import ModelRecipe, Recipe
from pipeline.models.domain import PHYSICS, Domain
from weaves.errors import BadInput
from weaves.errors import nearest as nearest_name

_SAID = ("model", "name", "recipe", "runtimes")  # by the recipe that measures; the rest is the teacher's to say


def with_teachers(
    content: Mapping[str, Any], where: str, load: Callable[[Any, str], Recipe]
) -> tuple[dict[str, Any], dict[str, Recipe]]:
    """Replace entries of models that another recipe trains by what that recipe says of them.

    Parameters
    ----------
    content : mapping
        A recipe's file.
    where : str
        Its path, for sentences.
    load : callable
        Returns the recipe of a name, which stands at a key of the file.

    Returns
    -------
    dict
        The file with those entries written out.
    dict
        From the name of each such model to the recipe that trains it.

    Raises
    ------
    BadInput
        If there is no such recipe or no such model in it, nothing to train, or more said than `_SAID`.
    """
    entries = content.get("models")
    if not isinstance(entries, list):
        return dict(content), {}
    models, teachers = [], {}
    for index, entry in enumerate(entries):
        if isinstance(entry, Mapping) and "recipe" in entry:
            model, teacher = _taken(entry, f"models.{index}", where, load)
            models.append(model)
            teachers[model["name"]] = teacher
        else:
            models.append(entry)
    return {**content, "models": models}, teachers


def refuse_unlike(recipe: Recipe, where: str) -> None:
    """Refuse models that another recipe trains so that they cannot stand beside this one's.

    Raises
    ------
    BadInput
        If the physics or a fabric of the same name differs, or a general model's fabrics do not fit.
    """
    for index, model in enumerate(recipe.models):
        if teacher := recipe.teachers.get(model.options.name):
            key = f"models.{index}.recipe"
            _refuse_physics(recipe, teacher, where)
            _refuse_namesakes(recipe, teacher, key, where)
            if not model.of_one_material:
                _refuse_fabrics(recipe, model, teacher, key, where)


def _taken(
    entry: Mapping[str, Any], key: str, where: str, load: Callable[[Any, str], Recipe]
) -> tuple[dict[str, Any], Recipe]:
    """Return a model's entry as another recipe has it, and the recipe that trains it."""
    teacher = load(entry["recipe"], f"{key}.recipe")
    known = {model.options.name: model for model in teacher.models}
    name = entry.get("name", entry.get("model"))
    if not isinstance(name, str) or name not in known:
        called = "name" if "name" in entry else "model"
        allowed = f"must be a model of the recipe {teacher.name}; {nearest_name(str(name), list(known), 'model')}"
        raise BadInput(where, f"{key}.{called}", name, allowed)
    model, options = known[name], known[name].options
    if entry.get("model", options.model) != options.model:
        allowed = f"{name} is {options.model} in the recipe {teacher.name}"
        raise BadInput(where, f"{key}.model", entry["model"], allowed)
    for more in entry.keys() - set(_SAID):
        raise BadInput(where, f"{key}.{more}", entry[more], f"leave it out: the recipe {teacher.name} says it")
    if not model.learns:
        raise BadInput(where, f"{key}.recipe", entry["recipe"], f"{name} has nothing to train: leave it out")
    said = options.model_dump() | {"training": model.training.model_dump()}
    said |= {"runtimes": entry["runtimes"]} if "runtimes" in entry else {}
    return said, teacher.teachers.get(name, teacher)


def _refuse_physics(recipe: Recipe, teacher: Recipe, where: str) -> None:
    for name in PHYSICS:
        own, other = (getattr(one.dataset.truth, name) for one in (recipe, teacher))
        if own != other:
            allowed = f"must be that of the recipe {teacher.name}, {other!r}"
            raise BadInput(where, f"dataset.truth.{name}", own, allowed)


def _refuse_namesakes(recipe: Recipe, teacher: Recipe, key: str, where: str) -> None:
    named = {fabric.name: fabric for fabric in (*recipe.seen, *recipe.unseen)}
    for other in (*teacher.seen, *teacher.unseen):
        if (own := named.get(other.name)) and own.optics() != other.optics():
            raise BadInput(where, key, teacher.name, f"another cloth is called {own.name} there: rename one of them")


def _refuse_fabrics(recipe: Recipe, model: ModelRecipe, teacher: Recipe, key: str, where: str) -> None:
    trained = (*teacher.seen, *teacher.population)
    optics = [fabric.optics() for fabric in trained]
    name = model.options.name
    for fabric in recipe.seen:
        if fabric.optics() not in optics:
            allowed = f"{name} must have been trained there on {fabric.name}, which is seen here"
            raise BadInput(where, key, teacher.name, allowed)
    seen = {fabric.weave.canonical() for fabric in recipe.seen}
    drafts = {fabric.weave.canonical(): fabric.name for fabric in trained}
    domain = Domain.of(teacher.dataset.model_dump(mode="json"), trained)
    for fabric in recipe.unseen:
        draft = fabric.weave.canonical()
        if draft not in seen and draft in drafts:
            allowed = f"{name} was trained there on {drafts[draft]}, of the draft of {fabric.name}, unseen here"
            raise BadInput(where, key, teacher.name, allowed)
        domain.refuse_fabric(fabric, name)
