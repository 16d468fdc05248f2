"""The entries of this repository: their board, and their Records measured again from their own answers."""

from pathlib import Path

import pytest

from jobs.plan.dataset import Shard
from jobs.plan.plan import plan
from jobs.recipe.load import load_recipe
from pipeline.shards.entry_files import read_answers
from pipeline.shards.queries import answered
from reports.measure.answers import measure_answers
from reports.measure.held_out import HeldOutFabric
from reports.options import ErrorOptions, select
from reports.record import Record, read_records

BOARD = Path(__file__).parents[4] / "reports" / "BOARD.md"
ENTRIES = sorted(path.parent for path in BOARD.parent.glob("entries/*/entry.toml"))


def test_the_board_is_of_the_entries(call, tmp_path):
    assert len(ENTRIES) > 1 and call("challenge", "board", *ENTRIES, "--to", tmp_path / "BOARD.md")[0] == 0
    assert (tmp_path / "BOARD.md").read_text(encoding="utf-8") == BOARD.read_text(encoding="utf-8")


@pytest.mark.parametrize("count", [1, pytest.param(30, marks=pytest.mark.slow)])
def test_answers_still_have_the_errors_of_their_records(count):
    """The truth of the first fabrics is computed anew; on another processor its last bits may differ."""
    recipe = load_recipe("challenge")
    shards = (task.shard for task in plan(recipe) if isinstance(task, Shard) and task.shard.split == "test")
    shard_of, rows = {shard.fabric.name: shard for shard in shards}, []
    for fabric, _ in recipe.tested[:count]:
        shard = shard_of[fabric.name]
        truth = answered(fabric, shard.drawn(), shard.truth, shard.stream("points"), shard.start, lambda rows: None)
        rows.append(HeldOutFabric(fabric, shard.drawn(), truth))
    roles, options = [role for _, role in recipe.tested[:count]], select(ErrorOptions, recipe.bench)
    for folder in ENTRIES:
        stated = {(own.fabric, own.metric): own for own in read_records([folder / "records.json"])}
        answers = read_answers(folder / "answers.parquet", recipe.dataset.rows.test * len(recipe.tested))
        answers = answers[: recipe.dataset.rows.test * count]
        errors = measure_answers(Record(method=folder.name), answers, rows, roles, 0, options)
        errors = [own for own in errors if own.fabric]  # the others are of all named fabrics together
        assert {own.fabric for own in errors} == set(list(shard_of)[:count])
        for own in errors:
            assert own.value == pytest.approx(stated[own.fabric, own.metric].value, rel=0.01), (folder.name, own)
