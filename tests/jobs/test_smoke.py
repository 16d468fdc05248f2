"""The whole way, from fabrics to the page, on a recipe of the package; then again, and what a scene requires."""

import pytest

from jobs.cli import main
from jobs.plan.plan import plan
from jobs.recipe.load import load_recipe
from jobs.run.ledger import Ledger

pytestmark = pytest.mark.external  # a cluster of dask


def test_the_smoke_recipe_from_fabrics_to_the_page(tmp_path, capsys):
    out = tmp_path / "out"
    tasks = plan(load_recipe("smoke"))
    assert main(["run", "smoke", "--out", str(out)]) == 0, capsys.readouterr().err
    assert str(out / "report" / "smoke" / "index.html") in capsys.readouterr().out.replace("\n", "")
    assert all(Ledger(out).state(task) == "done" for task in tasks)
    # What a run leaves: nothing half-written, nothing outside these folders.
    assert {path.name for path in out.iterdir()} == {"datasets", "ledger", "models", "records", "report"}
    assert not list(out.rglob(".tmp-*")) and main(["run", "smoke", "--out", str(out)]) == 0
    assert f"nothing to do: {len(tasks)} tasks done" in capsys.readouterr().out
    # What a scene requires is chosen from that page, and its recipe is one.
    asked = ["require", "curtain", "--out", str(out), "--recipe", "smoke", "--frames", "1"]
    assert main([*asked, "--error", "0.5"]) == 0, capsys.readouterr().err
    assert "measured here" in capsys.readouterr().out
    narrow = load_recipe(out / "recipes" / "require-curtain.toml")
    assert [fabric.name for fabric in narrow.seen] == ["voile"]
    assert narrow.dataset.queries.sigma[1] < load_recipe("smoke").dataset.queries.sigma[1] and plan(narrow)
    # A wish that nothing meets is answered with the nearest points of the front.
    assert main([*asked, "--error", "1e-9", "--time", "1e-3"]) == 2
    assert "nearest points of the front" in capsys.readouterr().err
