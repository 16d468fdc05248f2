"""Every recipe of the package runs from its fabrics to its page, at a hundredth of its rows, steps and pixels.

The recipes for clusters and GPUs, `full*`, are killed and resumed on the way.
"""

import time

import pytest

from jobs.cli import main
from jobs.plan.plan import plan
from jobs.recipe.load import load_recipe, recipe_names
from jobs.run.ledger import Ledger
from tests.faults.runs import start
from tests.jobs.small_recipes import MOST_MEMBERS, MOST_SEEDS, MOST_UNSEEN, write_small

KILLED_AFTER = 20  # tasks


@pytest.mark.parametrize("name", recipe_names())
def test_small_recipes_keep_fabrics_and_models(name, tmp_path):
    small, whole = load_recipe(write_small(name, tmp_path)), load_recipe(name)
    assert (small.seen, small.unseen) == (whole.seen, whole.unseen)
    assert small.population == whole.population[:MOST_MEMBERS]
    assert small.unseen_population == whole.unseen_population[:MOST_UNSEEN]
    assert [model.options.name for model in small.models] == [model.options.name for model in whole.models]
    assert [min(model.seeds, MOST_SEEDS) for model in whole.models] == [model.seeds for model in small.models]
    assert small.dataset.truth == whole.dataset.truth and small.bench.runtimes == whole.bench.runtimes
    for split, least in (("train", 128), ("population", 64), ("validation", 64), ("test", 128)):
        assert getattr(small.dataset.rows, split) <= max(getattr(whole.dataset.rows, split) // 100, least)


def kill_on_the_way(path, out):
    """Start a run and kill it when it has finished some tasks."""
    process = start(path, out)
    while len(list(out.glob("ledger/[!.]*.json"))) < KILLED_AFTER:
        assert process.poll() is None
        time.sleep(0.1)
    process.kill()
    process.communicate()


@pytest.mark.slow
@pytest.mark.parametrize("name", recipe_names())
def test_a_recipe_runs_from_its_fabrics_to_its_page(name, tmp_path, capsys):
    path, out = write_small(name, tmp_path), tmp_path / "out"
    if name.startswith("full"):
        kill_on_the_way(path, out)
    assert main(["run", str(path), "--out", str(out)]) == 0, capsys.readouterr().err
    assert all(Ledger(out).state(task) == "done" for task in plan(load_recipe(path)))
    assert (out / "report" / name / "index.html").exists()
    assert main(["check", str(path), "--out", str(out)]) == 0, capsys.readouterr().out
