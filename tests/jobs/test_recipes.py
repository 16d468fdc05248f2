"""Every recipe of the package runs from its fabrics to its page, at a hundredth of its rows, steps and pixels.

The recipes for clusters and GPUs, `full*`, are killed and resumed on the way.
"""

import time

import pytest

from jobs.cli import main
from jobs.plan.plan import plan
from jobs.recipe.load import load_recipe
from jobs.recipe.shipped import recipe_names
from jobs.run.ledger import Ledger
from pipeline.scenes.variant import llvm_works
from tests.faults.runs import start
from tests.jobs.small_recipes import MOST_MEMBERS, write_small

KILLED_AFTER = 20  # tasks
MARKS = {"mitsuba": pytest.mark.skipif(not llvm_works(), reason="no LLVM that Mitsuba can use")}


def kill_on_the_way(path, out):
    process = start(path, out)
    while len(list(out.glob("ledger/[!.]*.json"))) < KILLED_AFTER:
        assert process.poll() is None
        time.sleep(0.1)
    process.kill()
    process.communicate()


@pytest.mark.slow
@pytest.mark.parametrize("name", [pytest.param(name, marks=MARKS.get(name, ())) for name in recipe_names()])
def test_a_recipe_runs_from_its_fabrics_to_its_page(name, tmp_path, capsys):
    path, out = write_small(name, tmp_path), tmp_path / "out"
    small, whole = load_recipe(path), load_recipe(name)
    assert (small.seen, small.unseen, small.population) == (whole.seen, whole.unseen, whole.population[:MOST_MEMBERS])
    assert [model.options.name for model in small.models] == [model.options.name for model in whole.models]
    assert small.dataset.truth == whole.dataset.truth and small.bench.runtimes == whole.bench.runtimes
    if name.startswith("full"):
        kill_on_the_way(path, out)
    assert main(["run", str(path), "--out", str(out)]) == 0, capsys.readouterr().err
    assert all(Ledger(out).state(task) == "done" for task in plan(small))
    assert (out / "report" / name / "index.html").exists()
    assert main(["check", str(path), "--out", str(out)]) == 0, capsys.readouterr().out
