"""`twillight check` of a recipe: its shards, models, Records, pages, receipts and manifests; with `--repair`, again.

Exit codes: 0 all is there and sound, 1 something is missing or outdated, 2 something is cut, damaged, odd or foreign.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from jobs.plan.dataset import Shard
from jobs.plan.page import Page
from jobs.plan.plan import plan
from jobs.plan.task import STAGES, Task
from jobs.recipe.load import load_recipe
from jobs.run.faults import Fault, faults
from jobs.run.ledger import Ledger
from jobs.terminal import MOST_SENTENCES, print_lines, progress
from jobs.verbs.parameters import WorkerFlags
from jobs.verbs.run import work
from weaves.errors import BadInput, WorkFailed

_HARMLESS: Final = ("missing", "outdated")


def check_recipe(name: str, out: Path, add: Sequence[str] = ()) -> int:
    """Compare the files of a recipe with what its plan needs, print a sentence a fault, and return the exit code."""
    tasks, wrong = _faults_of(name, out, add)
    _print(wrong, out)
    if not wrong:
        _print_sound(name, tasks)
    elif any(fault.kind in ("cut", "damaged") for fault in wrong):
        print_lines(f"`twillight check {name} --repair` makes exactly these files again", stderr=True)
    elif any(fault.kind in _HARMLESS for fault in wrong):
        print_lines(f"`twillight run {name}` makes what is missing", stderr=True)
    return exit_code(wrong)


def repair(name: str, out: Path, on: WorkerFlags, add: Sequence[str] = ()) -> int:
    """Remove the damaged files of a recipe, run exactly their tasks again, and return the exit code.

    Stages of which nothing was ever made are left out. Shards, weights and cards come back byte for byte; times are
    measured again, and the page that shows them is written again. BadInput if the recipe, the folder or the scheduler
    cannot be used; WorkFailed if a task failed, or another run is at work in the folder.
    """
    ledger = Ledger(out)
    if not ledger.exists():
        raise BadInput(str(out), "", "holds no products", f"`twillight run {name}` makes them")
    with ledger.store.held():
        tasks, wrong = _faults_of(name, out, add)
        _print(wrong, out)
        for fault in wrong:
            _remove(fault, ledger)
    planned, never_run = Counter(task.stage for task in tasks), Counter[str]()
    for fault in wrong:
        if fault.never_run and fault.task:
            never_run[fault.task.stage] += fault.tasks
    if any(fault.kind != "foreign" for fault in wrong):
        if stages := [stage for stage in STAGES if not 0 < never_run[stage] == planned[stage]]:
            work(name, stages, out, on, add)
        wrong = _faults_of(name, out, add)[1]
        if wrong:
            print_lines("what is left:", stderr=True)
            _print(wrong, out)
    if not wrong:
        _print_sound(name, tasks)
    return exit_code(wrong)


def exit_code(wrong: Sequence[Fault]) -> int:
    """Return the exit code of faults."""
    if any(fault.kind not in _HARMLESS for fault in wrong):
        return BadInput.exit_code
    return WorkFailed.exit_code if wrong else 0


def _faults_of(name: str, out: Path, add: Sequence[str]) -> tuple[list[Task], list[Fault]]:
    """Return the plan of a recipe and the faults of its files."""
    recipe = load_recipe(name, add)
    tasks = plan(recipe)
    with progress("checking") as advance:
        return tasks, faults(recipe, tasks, Ledger(out), advance)


def _remove(fault: Fault, ledger: Ledger) -> None:
    """Remove what a fault is about, so that its task counts as missing; manifests are written again by each run."""
    if fault.task is None or fault.kind not in ("cut", "damaged", "missing"):
        return
    if fault.path == ledger.receipt_path(fault.task):
        ledger.store.remove(fault.path)
    ledger.discard(fault.task)
    if isinstance(fault.task, Page):  # its other files are not on the receipt
        ledger.store.remove(fault.task.products[0])


def _print(wrong: Sequence[Fault], out: Path) -> None:
    """Print a sentence a fault, those of damage first, and count the others beyond a number."""
    order = ["damaged", "cut", "odd", "foreign", "outdated", "missing"]
    ordered = sorted(wrong, key=lambda fault: order.index(fault.kind))
    print_lines(*(f"{out / fault.path}: {fault.kind}: {fault.why}" for fault in ordered[:MOST_SENTENCES]), stderr=True)
    if more := Counter(fault.kind for fault in ordered[MOST_SENTENCES:]):
        print_lines(f"and {', '.join(f'{count:,} {kind}' for kind, count in more.items())} more", stderr=True)


def _print_sound(name: str, tasks: Sequence[Task]) -> None:
    """Print what was found sound."""
    parts = [task for task in tasks if isinstance(task, Shard)]
    count = Counter(task.stage for task in tasks)
    rows = sum(part.rows for part in parts)
    models = f"{count['train']:,} models, {count['bench']:,} measurements"
    print_lines(f"{name}: {len(parts):,} shards with {rows:,} rows, {models} and the page are sound")
