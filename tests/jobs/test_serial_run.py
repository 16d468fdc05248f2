"""A run of the smallest recipe, from a fabric to its page, task after task in this process: no cluster, no scene."""

import numpy as np

from jobs.cli import main
from jobs.plan.plan import plan
from jobs.recipe.load import load_recipe
from jobs.run.ledger import Ledger
from reports.images.tiles import png
from reports.page import page
from reports.record import read_records
from tests.jobs.small_recipes import write_smallest

PLOT = png(np.zeros((1, 1, 4), np.uint8))


def test_a_recipe_becomes_a_page(tmp_path, here, coarse_truth, capsys, monkeypatch):
    """Its plots are made and not drawn, which takes half of the time; `tests/reports/page` draws each of them."""
    made = []
    monkeypatch.setattr(page, "render", lambda plot, *data: made.append(plot(*data)) or PLOT)
    recipe = write_smallest(tmp_path, "serial")
    command = ["run", str(recipe), "--out", str(tmp_path / "out")]
    assert main(command) == 0, capsys.readouterr().err
    tasks = plan(load_recipe(recipe))
    assert all(Ledger(tmp_path / "out").state(task) == "done" for task in tasks)
    folder = tmp_path / "out" / "report" / "serial"
    records = read_records([folder / "records.json"])
    assert {record.method for record in records} >= {"neumip", "point_sampled", "truth"}
    assert made and "<table" in (folder / "index.html").read_text(encoding="utf-8")
    capsys.readouterr()
    assert main(command) == 0 and f"nothing to do: {len(tasks)} tasks done" in capsys.readouterr().out
