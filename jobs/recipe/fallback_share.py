"""Fallback share of a method in a scene, predicted from its domain before it is trained or loaded."""

from __future__ import annotations

from collections.abc import Iterable
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jobs.recipe.recipe import ModelRecipe, Recipe
    from pipeline.truth.query import Queries
    from weaves.fabric import Fabric


def fallback_share(model: ModelRecipe, recipe: Recipe, queries_by_fabric: Iterable[tuple[Fabric, Queries]]) -> float:
    """Return the share of queries that fall back for a model, as a benchmark would measure it; `recipe` trains it.

    All queries fall back on a fabric that a model of one material was not trained on.
    """
    import numpy as np

    from pipeline.models.domain import Domain
    from pipeline.models.fallback import Fallback

    queries_by_fabric = list(queries_by_fabric)
    fabrics = [fabric for fabric, _ in queries_by_fabric]
    known = fabrics
    if model.of_one_material:
        optics = [fabric.optics() for fabric in recipe.seen + recipe.unseen]
        known = [fabric for fabric in fabrics if fabric.optics() in optics]
    options = model.options
    domain = None
    if model.learns:
        learnt_from = recipe.seen + (recipe.unseen if model.of_one_material else recipe.population)
        domain = Domain.of(recipe.dataset.model_dump(mode="json"), learnt_from)
    method: Any = SimpleNamespace(name="", setting="", domain=domain, turns=options.turns)
    fallback = Fallback(method, options.kinds, recipe.bench.scenes.footprint)
    fallback_rows = [
        fallback.out_of_domain(fabric, queries) if fabric in known else np.ones(len(queries.u), np.bool_)
        for fabric, queries in queries_by_fabric
    ]
    return float(np.concatenate(fallback_rows).mean())
