import pytest

from jobs.plan.task import Task, urgencies


def task(name, stage="generate", **options):
    return Task(stage, stage, name, {"name": name}, (f"{name}.txt",), **options)


def test_only_stage_and_specification_make_the_identity():
    one = Task("train", "group", "a title", {"x": 1}, ("a",), needs=("n",), cost=2.0, setting={"folder": "a"})
    two = Task("train", "other", "another", {"x": 1}, ("b",))
    assert one.id == two.id
    assert one.id != Task("bench", "group", "a title", {"x": 1}, ("a",)).id
    assert one.id != Task("train", "group", "a title", {"x": 2}, ("a",)).id


def test_a_specification_with_nan_is_refused():
    with pytest.raises(ValueError):
        Task("train", "group", "title", {"x": float("nan")}, ())


def test_the_longest_chain_is_the_most_urgent():
    short, long = task("short", cost=5), task("long", cost=1)
    after = task("after", "train", needs=(long.id, "done before"), cost=30)
    assert urgencies([short, long, after]) == {short.id: 5, long.id: 31, after.id: 30}
