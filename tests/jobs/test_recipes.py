"""Every recipe of the package runs from its fabrics to its page, at a hundredth of its rows, steps and pixels."""

import pytest

from jobs.cli import main
from jobs.plan.plan import plan
from jobs.recipe.load import load_recipe, recipe_names
from jobs.run.ledger import Ledger
from tests.jobs.small_recipes import MOST_MEMBERS, write_small


@pytest.mark.parametrize("name", recipe_names())
def test_small_recipes_keep_fabrics_and_models(name, tmp_path):
    small, whole = load_recipe(write_small(name, tmp_path)), load_recipe(name)
    assert (small.seen, small.unseen) == (whole.seen, whole.unseen)
    assert small.population == whole.population[:MOST_MEMBERS]
    assert [model.options.name for model in small.models] == [model.options.name for model in whole.models]
    assert small.dataset.truth == whole.dataset.truth and small.bench.runtimes == whole.bench.runtimes
    for split, least in (("train", 128), ("population", 64), ("validation", 64), ("test", 128)):
        assert getattr(small.dataset.rows, split) <= max(getattr(whole.dataset.rows, split) // 100, least)


@pytest.mark.slow
@pytest.mark.parametrize("name", recipe_names())
def test_a_recipe_runs_from_its_fabrics_to_its_page(name, tmp_path, capsys):
    path, out = write_small(name, tmp_path), tmp_path / "out"
    assert main(["run", str(path), "--out", str(out)]) == 0, capsys.readouterr().err
    assert all(Ledger(out).state(task) == "done" for task in plan(load_recipe(path)))
    assert (out / "report" / name / "index.html").exists()
    assert main(["check", str(path), "--out", str(out)]) == 0, capsys.readouterr().out
