"""What the sections of a recipe must not say together: each may be right by itself."""

from __future__ import annotations

from jobs.recipe.recipe import Recipe
from pipeline.truth.options import TruthOptions
from weaves.errors import BadInput


def refuse_contradictions(recipe: Recipe, where: str) -> None:
    """Refuse sections that do not fit together.

    Raises
    ------
    BadInput
        For names given twice, an unseen draft in the population, other physics for training rows than for the rest,
        and models that do not know the queries or the physics of the data set.
    """
    for key, names in (
        ("dataset", [fabric.name for fabric in recipe.fabrics]),
        ("models", [model.options.name for model in recipe.models]),
    ):
        for name in names:
            if names.count(name) > 1:
                raise BadInput(where, key, name, "names must differ, because files are called by them")
    if recipe.population and not recipe.dataset.rows.population:
        raise BadInput(where, "dataset.rows.population", 0, "must be > 0 when dataset.population.count is")
    # Where a seen fabric has the same draft, it is the yarns that are unseen.
    seen = {fabric.weave.canonical() for fabric in recipe.seen}
    unseen = {fabric.weave.canonical(): fabric for fabric in recipe.unseen if fabric.weave.canonical() not in seen}
    for member in recipe.population:
        if fabric := unseen.get(member.weave.canonical()):
            allowed = f"must name {fabric.weave.name!r}, else the draft of {fabric.name} is seen in training"
            raise BadInput(where, "dataset.population.exclude", list(recipe.dataset.population.exclude), allowed)
    truth, training_truth = recipe.dataset.truth, recipe.dataset.truth_of("train")
    for name in ("footprint", "frame", "normaliser", "geometry", "shadows", "variation"):
        if (value := getattr(training_truth, name)) != getattr(truth, name):
            allowed = f"must be that of dataset.truth, {getattr(truth, name)!r}"
            raise BadInput(where, f"dataset.training_truth.{name}", value, allowed)
    queries = recipe.dataset.queries
    asked = {"behind": queries.behind > 0, "stretch": queries.stretch > 1, "curvature": queries.curvature[1] > 0}
    plain = TruthOptions()
    if recipe.bench.bounds and (kinds := [kind for kind, there in asked.items() if there]):
        raise BadInput(where, "bench.bounds", True, f"the bound does not know queries with {' and '.join(kinds)}")
    for index, model in enumerate(recipe.models):
        for kind in (kind for kind, there in asked.items() if there and kind not in model.options.kinds):
            allowed = f"does not know queries with {kind}: leave it out, or dataset.queries.{kind}"
            raise BadInput(where, f"models.{index}.name", model.options.name, allowed)
        for name in () if model.options.any_physics else ("frame", "normaliser", "geometry", "shadows", "variation"):
            if (value := getattr(truth, name)) != (own := getattr(plain, name)):
                allowed = f"{model.options.name} (models.{index}) knows {name} = {own!r} only"
                raise BadInput(where, f"dataset.truth.{name}", value, allowed)
        footprint = getattr(model.options, "footprint", truth.footprint)
        if footprint != truth.footprint:
            key = f"models.{index}.footprint"
            raise BadInput(where, key, footprint, f"must be that of dataset.truth, {truth.footprint!r}")
