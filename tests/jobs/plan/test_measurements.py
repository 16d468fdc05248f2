from dataclasses import replace
from importlib import import_module
from typing import Annotated, Union, get_args

import numpy as np
import pytest
from pydantic import Field, TypeAdapter

from jobs.plan.measurements import scenes, truth
from jobs.plan.plan import KINDS, plan
from jobs.recipe.entry import Entry, EntryForm
from jobs.recipe.load import load_recipe
from reports.catalogue import AddedMetric
from reports.options import StudyName
from reports.record import read_records
from reports.truth import finding, stability
from weaves.errors import WorkFailed

ANY = TypeAdapter(Annotated[Union[(*KINDS, scenes.OnScene)], Field(discriminator="kind")])


@pytest.fixture(scope="module")
def tasks():
    """The measurements of recipes that together have every kind."""
    recipes = [load_recipe(name) for name in ("smoke", "standard", "curved", "mitsuba")]
    words = {"name": "theirs", "title": "theirs", "definition": "Theirs.", "unit": "1"}
    words |= {"better": "lower", "format": "percent", "stated": "1"}
    metric = AddedMetric(source="/theirs.py:theirs", sha256="0" * 64, **words)
    filled = dict.fromkeys(("name", "authors", "version", "machine", "training"), "theirs") | {"source": ""}
    filled |= {"questions": "0" * 16, "nanoseconds": 1, "threads": 1, "tries": 1, "each_fabric": False}
    entry = Entry(EntryForm(**filled, bytes_stored=0, multiply_adds=0), "0" * 64, "/records/answers.csv")
    first, *others = recipes[0].models
    own = {"entries": (entry,), "metrics": (metric,), "models": (first.model_copy(update={"seeds": 2}), *others)}
    recipes[0] = replace(recipes[0], **own)
    return [task for recipe in recipes for task in plan(recipe) if task.stage == "bench"]


def test_every_kind_is_planned_and_read_back_from_its_own_dump(tasks):
    """Its identity has what it needs and no path; so no result outlives what it was made from."""
    assert {type(task) for task in tasks} == {*KINDS, scenes.OnScene}
    for task in tasks:
        again = ANY.validate_json(task.model_dump_json())
        assert type(again) is type(task) and again.id == task.id
        assert again.products == task.products and again.needs == task.needs
        text = str(task.identity())
        assert not any(folder in text for folder in ("models/", "records/", "datasets/")), task.title
        assert all(need in text for need in task.needs), task.title


def test_every_study_is_in_a_shipped_recipe():
    named = {name: load_recipe(name).bench.studies for name in ("truth", "mitsuba", "real")}
    assert sorted(sum(named.values(), ())) == sorted(get_args(StudyName))
    for name in sum(named.values(), ()):
        module = import_module(f"reports.truth.{name}")
        assert callable(module.measure) and module.RECORDS
    assert truth.Study(study="throughput").versions().keys() == {"truth", "bench", "fallback", "selvage", "soft_nodes"}


def test_a_study_records_what_its_module_yields_and_fails_on_an_unstable_expression(tmp_path, monkeypatch):
    monkeypatch.setattr(stability, "expressions", lambda: ["x"])
    monkeypatch.setattr(stability, "places", list)
    monkeypatch.setattr(stability, "footprints", list)
    (tmp_path / "records").mkdir()
    study = truth.Study(study="stability")
    good, bad = (
        finding.judge("x", "corner", "float32", {"x": np.arange(1)}, [value], [1.0], 1e-6) for value in (1.0, 1.1)
    )
    monkeypatch.setattr(stability, "judged", lambda expression: [good])
    study.run(tmp_path, lambda share: None)
    assert finding.RECORDS.from_records(read_records([tmp_path / study.records])) == [good]
    monkeypatch.setattr(stability, "judged", lambda expression: [bad])
    with pytest.raises(WorkFailed, match=r"x in float32, corner: worst error 1\.0e-01"):
        study.run(tmp_path, lambda share: None)
