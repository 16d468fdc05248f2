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
    """Return the share of queries that fall back for a model, as the benchmark of `recipe` would measure it.

    All queries fall back on a fabric that a model of one material was not trained on.
    """
    import numpy as np

    from pipeline.models.domain import Domain
    from pipeline.models.fallback import Fallback

    options, alone, trainer = model.options, model.options.of_one_material, recipe.trainer_of(model)
    learnt_from = trainer.seen + (trainer.unseen if alone else trainer.population)
    domain = Domain.of(trainer.dataset.model_dump(mode="json"), learnt_from) if options.learns else None
    method: Any = SimpleNamespace(name="", setting="", domain=domain, turns=options.turns)
    fallback = Fallback(method, options.kinds, recipe.bench.scenes.footprint)
    optics, fallback_rows = [fabric.optics() for fabric in learnt_from] if alone else [], []
    for fabric, queries in queries_by_fabric:
        known = not alone or fabric.optics() in optics
        fallback_rows.append(fallback.out_of_domain(fabric, queries) if known else np.ones(len(queries.u), np.bool_))
    return float(np.concatenate(fallback_rows).mean())
