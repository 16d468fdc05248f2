"""Measurements: every kind is planned, read back from its own dump, and says what it depends on."""

from dataclasses import replace
from typing import Annotated, Union

import pytest
from pydantic import Field, TypeAdapter

from jobs.plan.measurements.catalogue import KINDS
from jobs.plan.plan import plan
from jobs.recipe.load import load_recipe
from reports.added_metric import AddedMetric

ANY = TypeAdapter(Annotated[Union[KINDS], Field(discriminator="kind")])  # noqa: UP007


@pytest.fixture(scope="module")
def tasks():
    """The measurements of recipes that together have every kind."""
    recipes = [load_recipe(name) for name in ("smoke", "standard", "curved")]
    words = {"name": "theirs", "title": "theirs", "definition": "Theirs.", "unit": "1"}
    words |= {"better": "lower", "format": "percent", "stated": "1"}
    recipes[0] = replace(recipes[0], metrics=(AddedMetric(source="/theirs.py:theirs", sha256="0" * 64, **words),))
    first, *others = recipes[0].models
    recipes[0] = replace(recipes[0], models=(first.model_copy(update={"seeds": 2}), *others))
    return [task for recipe in recipes for task in plan(recipe) if task.stage == "bench"]


def test_every_kind_is_planned(tasks):
    assert {type(task) for task in tasks} == set(KINDS)


def test_a_measurement_is_read_back_from_its_own_dump(tasks):
    for task in tasks:
        again = ANY.validate_json(task.model_dump_json())
        assert type(again) is type(task) and again.id == task.id
        assert again.products == task.products and again.needs == task.needs


def test_no_path_of_another_tasks_product_is_part_of_an_identity(tasks):
    for task in tasks:
        text = str(task.identity())
        assert not any(folder in text for folder in ("models/", "records/", "datasets/")), task.title


def test_what_a_measurement_needs_is_part_of_its_identity(tasks):
    """Of the rows their ids; so no result outlives what it was made from."""
    for task in tasks:
        text = str(task.identity())
        assert all(need in text for need in task.needs), task.title
