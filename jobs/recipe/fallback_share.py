"""What a method would leave to quadrature in a scene, told from what it was taught, before it is loaded or trained."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jobs.recipe.recipe import ModelRecipe, Recipe
    from pipeline.models.domain import Domain
    from pipeline.truth.query import Queries
    from weaves.fabric import Fabric


class _Taught:
    """A method of which no more is known than its domain."""

    name = setting = ""

    def __init__(self, domain: Domain | None) -> None:
        self.domain = domain


def left_to_quadrature(model: ModelRecipe, recipe: Recipe, asked: Iterable[tuple[Fabric, Queries]]) -> float:
    """Return the share of questions that a model of a recipe does not answer itself, as a benchmark would find it.

    Parameters
    ----------
    model : ModelRecipe
        One of the recipe's.
    recipe : Recipe
        Whose data it is trained on.
    asked : iterable
        Fabrics and the questions about each; all about a fabric that a model of one material was not trained on are
        left.
    """
    import numpy as np

    from pipeline.models.fallback import Fallback

    asked = list(asked)
    fabrics = [fabric for fabric, _ in asked]
    known = fabrics
    if model.of_one_material:
        optics = [fabric.optics() for fabric in recipe.seen + recipe.unseen]
        known = [fabric for fabric in fabrics if fabric.optics() in optics]
    method: Any = _Taught(_domain(model, recipe))
    fallback = Fallback(method, model.options.kinds, recipe.bench.scenes.footprint)
    left = [
        fallback.strange(fabric, queries) if fabric in known else np.ones(len(queries.u), np.bool_)
        for fabric, queries in asked
    ]
    return float(np.concatenate(left).mean())


def _domain(model: ModelRecipe, recipe: Recipe) -> Domain | None:
    """Return what a model is taught, as its card will say; None if nothing is trained."""
    from pipeline.models.domain import Domain

    if not model.learns:
        return None
    learnt_from = recipe.seen + (recipe.unseen if model.of_one_material else recipe.population)
    return Domain.of(recipe.dataset.model_dump(mode="json"), learnt_from)
