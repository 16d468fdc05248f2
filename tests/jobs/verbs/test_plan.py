import re
from pathlib import Path

import pytest

from jobs.run.ledger import ELSEWHERE, Ledger
from jobs.run.receipt import Product
from jobs.verbs.plan import facts_of


@pytest.fixture
def out(files, tmp_path):
    """Return a folder with products of one byte, and receipts, of all shards."""
    ledger = Ledger(tmp_path / "out")
    for task in (task for task in files.plan() if task.stage == "generate"):
        for path in map(ledger.out.joinpath, task.products):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(b"x")
        product = Product(sha256="0" * 64, bytes=1)
        ledger.finish(task, {Path(path).name: product for path in task.products}, 200 * task.cost)
    return ledger.out


def test_the_changed_key_of_a_recipe_is_named(files, out, twillight):
    code, told, _ = twillight("plan", files.exchange("relative_error = 0.05", "relative_error = 0.04").write())
    assert code == 0 and ": changed: truth.relative_error 0.05 → 0.04\n" in told
    assert "never made" in told and "done" not in told
    code, told, _ = twillight("plan", files.exchange("relative_error = 0.04", "relative_error = 0.05").write())
    assert code == 0 and "done" in told and "changed" not in told


def test_estimates_are_scaled_by_what_was_measured(files, out):
    tasks = files.exchange("train = 2500", "train = 4500").plan()
    facts = facts_of(tasks, Ledger(out))
    new = [task for task in facts.left(tasks) if task.stage == "generate"]
    # The data set has another folder now; what both have is only linked.
    shared = [task for task in tasks if facts.why.get(task.id) == ELSEWHERE]
    assert len(shared) > len(new) > 0
    for task in new:
        assert 20 * task.cost < facts.seconds[task.id] < 200 * task.cost
    training = next(task for task in tasks if task.stage == "train")
    assert facts.seconds[training.id] > 2 * training.cost  # another stage, of which nothing was done


def test_schedules_and_prices_are_of_what_is_left_and_a_folder_that_is_not_there_has_new_tasks(
    files, out, call, tmp_path
):
    code, told, _ = call("plan", files.write(), "--workers", "3")
    assert code == 0
    for part in ("3 workers: ", "workers save less than 5%", "durations are measured"):
        assert part in told
    costs = []
    for price in (1000, 2000):
        told = call("plan", files.write(), "--price", price)[1]
        hours, cost = re.search(rf"to do: ([\d,.]+) core-hours, ([\d,.]+) at {price} each", told).groups()
        costs.append(float(cost.replace(",", "")))
        assert costs[-1] == pytest.approx(price * float(hours), abs=0.005 * price)
    assert costs[1] == pytest.approx(2 * costs[0], abs=0.02) and costs[0] > 0
    assert "core-hours" not in call("plan", files.write())[1]
    code, told, _ = call("plan", files.write(), "--out", "none")
    assert code == 0 and "never made" in told and not (tmp_path / "none").exists()
