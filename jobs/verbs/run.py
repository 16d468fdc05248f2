"""Stages of a recipe: plan, lock the output folder, execute, update the manifest, print a summary."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from jobs.plan.dataset import DataSet
from jobs.plan.page import Page
from jobs.plan.plan import plan
from jobs.plan.task import STAGES, Stage, Task
from jobs.recipe.load import load_recipe
from jobs.run.executor import execute
from jobs.run.ledger import Ledger
from jobs.run.manifest_file import ManifestFile
from jobs.terminal import duration, number, print_lines, print_table
from jobs.verbs.parameters import NOTHING, ON, OUT, Add, On, Out, RecipeName, WorkerFlags
from weaves.errors import WorkFailed


def _verb(*stages: Stage) -> Callable[..., None]:
    """Return the function of the verb that runs some stages of a recipe."""

    def verb(recipe: RecipeName, *, add: Add = NOTHING, out: Out = OUT, on: On = ON) -> None:
        work(recipe, stages, out, on, add)

    return verb


generate, train, bench, report = map(_verb, STAGES)
run = _verb(*STAGES)


def work(recipe_name: str, stages: Sequence[Stage], out: Path, on: WorkerFlags, add: Sequence[str] = ()) -> None:
    """Run the unfinished tasks of some stages of a recipe and print a summary; `add`: methods from outside.

    BadInput if the recipe, the folder or the scheduler cannot be used; WorkFailed if any task failed, when the others
    are done.
    """
    recipe = load_recipe(recipe_name, add)
    tasks = plan(recipe)
    page = next(task for task in tasks if isinstance(task, Page))
    ledger = Ledger(out)
    with ledger.store.held():
        manifests = [ManifestFile(DataSet(member), ledger) for member in recipe.together]
        for manifest in manifests:
            manifest.save()  # whatever its file holds now
        if "bench" in stages:
            _withdraw(page, tasks, ledger)
        summary = execute(
            tasks,
            ledger,
            stages=stages,
            scheduler=on.connection(),
            workers=on.workers,
            manifests=manifests,
            progress=on.progress,
        )
    chosen = [task for task in tasks if task.stage in stages]
    if not summary.ran and not summary.failed:
        print_lines(f"nothing to do: {len(chosen)} tasks done")
    else:
        _print_work(chosen, {task.id: ledger.seconds(task) for task in summary.ran})
    if "report" in stages and ledger.state(page) == "done":
        print_lines("")
        _print_methods([out / path for path in page.records])
        print_lines("", f"the page: {(out / page.products[0]).resolve()}")
    if summary.failed:
        first, *others = summary.failed
        flags = "".join(f" --add {source}" for source in add)
        more = f"; {len(others)} more failed" if others else ""
        waiting = f"; {len(summary.waiting)} tasks wait for what failed" if summary.waiting else ""
        raise WorkFailed(
            f"{first.title}: {ledger.reason(first)}{more}{waiting}; see `twillight status {recipe_name}{flags}`"
        )


def _withdraw(page: Page, tasks: Sequence[Task], ledger: Ledger) -> None:
    """Remove a finished page if times that it shows will be measured again: they will not be the same."""
    timed = [task for task in tasks if task.slots == "all" and task.id in page.needs]
    if ledger.state(page) == "done" and any(ledger.state(task) != "done" for task in timed):
        ledger.store.remove(page.products[0])


def _print_work(tasks: Sequence[Task], ran: Mapping[str, float]) -> None:
    """Print the tasks of a run by stage, how many of them it did, and the seconds of work in them."""
    rows = []
    for stage in STAGES:
        if ids := [task.id for task in tasks if task.stage == stage]:
            now = [ran[key] for key in ids if key in ran]
            rows.append((stage, len(ids), len(now), duration(sum(now)) if now else ""))
    print_table(("stage", "tasks", "done now", "work"), rows)


def _print_methods(records: Sequence[Path]) -> None:
    """Print a benchmark condensed to one row a method, from the files of its Records.

    Bytes are left to the page, so that a line fits a terminal of 80 columns.
    """
    from reports.record import read_records
    from reports.tables.number_format import NO_BREAK
    from reports.tables.summary import summary_table

    frame = summary_table(read_records(records))
    frame = frame.drop(columns="bytes", errors="ignore").rename(columns={"ns/query": "ns a query"})
    rows = []
    for (method, setting), *values in frame.itertuples():
        rows.append((f"{method} {setting}".strip().replace(" ", NO_BREAK), *map(number, values)))
    print_table(("method", *frame.columns), rows, gap=1)
