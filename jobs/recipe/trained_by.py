"""Models that another recipe trains: ``[[models]] model = "curved", recipe = "trade_curved"``.

A data set has one distribution of queries, and some models need another: light from behind, curved cloth. The other
recipe then holds the model's options, its training and its rows; tasks and products are those of that recipe. This
recipe measures the result beside its own models.

A model of many fabrics must have been trained on every fabric that is seen here, on no draft that is unseen here, and
on yarns like those of all. So "seen" and "unseen" mean the same for it as for the others. A model of one material is
measured on the fabrics it was trained on and left out on the others.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from jobs.recipe.recipe import ModelRecipe, Recipe
from pipeline.models.added.added_code import ADDED_MODEL
from pipeline.models.domain import PHYSICS, Domain
from weaves.errors import BadInput, nearest

_KEYS = ("model", "name", "recipe", "runtimes")  # of an entry; all other keys are in the recipe that trains


def with_trained_by(
    entries: Sequence[Any], where: str, load: Callable[[Any, str], Recipe]
) -> tuple[list[Any], dict[str, Recipe]]:
    """Replace entries of models that another recipe trains by their entries there.

    Return the models of a file with those entries written out, and the recipe that trains each such model, by its name.
    `load` returns the recipe of a name, which stands at a key of the file. BadInput if there is no such recipe or no
    such model in it, nothing to train, or another key than `_KEYS`.
    """
    models, trained_by = [], {}
    for index, entry in enumerate(entries):
        if isinstance(entry, Mapping) and "recipe" in entry:
            entry, trainer = _taken_over(entry, f"models.{index}", where, load)
            trained_by[entry["name"]] = trainer
        models.append(entry)
    return models, trained_by


def check_trained_by(recipe: Recipe, where: str) -> None:
    """Check that models which another recipe trains can be measured beside this one's.

    BadInput if the physics or a fabric of the same name differs, or a general model's fabrics do not fit.
    """
    named = {fabric.name: fabric for fabric in (*recipe.seen, *recipe.unseen)}
    for index, model in enumerate(recipe.models):
        if trainer := recipe.trained_by.get(model.options.name):
            key = f"models.{index}.recipe"
            for name in PHYSICS:
                own, other = (getattr(each.dataset.truth, name) for each in (recipe, trainer))
                if own != other:
                    allowed = f"must be that of the recipe {trainer.name}, {other!r}"
                    raise BadInput(where, f"dataset.truth.{name}", own, allowed)
            for fabric in (*trainer.seen, *trainer.unseen):
                if (cloth := named.get(fabric.name)) and cloth.optics() != fabric.optics():
                    allowed = f"another cloth is called {fabric.name} there: rename one of them"
                    raise BadInput(where, key, trainer.name, allowed)
            if not model.options.of_one_material:
                _refuse_fabrics(recipe, model, trainer, key, where)


def _taken_over(
    entry: Mapping[str, Any], key: str, where: str, load: Callable[[Any, str], Recipe]
) -> tuple[dict[str, Any], Recipe]:
    """Return a model's entry in another recipe, and the recipe that trains it."""
    trainer = load(entry["recipe"], f"{key}.recipe")
    known = {model.options.name: model for model in trainer.models}
    called = "name" if "name" in entry else "model"
    name = entry.get(called)
    if not isinstance(name, str) or name not in known:
        allowed = f"must be a model of the recipe {trainer.name}; {nearest(str(name), known)}"
        raise BadInput(where, f"{key}.{called}", name, allowed)
    model, options = known[name], known[name].options
    kind = options.name if options.model == ADDED_MODEL else options.model
    if entry.get("model", kind) != kind:
        raise BadInput(where, f"{key}.model", entry["model"], f"{name} is {kind} in the recipe {trainer.name}")
    for more in entry.keys() - set(_KEYS):
        raise BadInput(where, f"{key}.{more}", entry[more], f"leave it out: the recipe {trainer.name} says it")
    if not model.options.learns:
        raise BadInput(where, f"{key}.recipe", entry["recipe"], f"{name} has nothing to train: leave it out")
    whole = options.model_dump() | {"training": model.training.model_dump(), "seeds": model.seeds}
    whole |= {"runtimes": entry["runtimes"]} if "runtimes" in entry else {}
    return whole, trainer.trained_by.get(name, trainer)


def _refuse_fabrics(recipe: Recipe, model: ModelRecipe, trainer: Recipe, key: str, where: str) -> None:
    trained = (*trainer.seen, *trainer.population)
    optics = [fabric.optics() for fabric in trained]
    name = model.options.name
    for fabric in recipe.seen:
        if fabric.optics() not in optics:
            allowed = f"{name} must have been trained there on {fabric.name}, which is seen here"
            raise BadInput(where, key, trainer.name, allowed)
    seen = {fabric.weave.canonical() for fabric in recipe.seen}
    drafts = {fabric.weave.canonical(): fabric.name for fabric in trained}
    domain = Domain.of(trainer.dataset.model_dump(mode="json"), trained)
    for fabric in (*recipe.unseen, *recipe.unseen_population):
        draft = fabric.weave.canonical()
        if draft not in seen and draft in drafts:
            allowed = f"{name} was trained there on {drafts[draft]}, of the draft of {fabric.name}, unseen here"
            raise BadInput(where, key, trainer.name, allowed)
        domain.refuse_fabric(fabric, name)
