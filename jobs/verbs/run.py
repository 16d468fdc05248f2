"""Stages of a recipe: plan, lock the output folder, execute, update the manifest, print a summary.

A stage may be divided into parts, each for one of several processes that know nothing of each other. They write
products and receipts. Manifests, and what cannot be divided, are left to the same verb without `--part`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, NamedTuple

from cyclopts import Parameter

from jobs.plan.dataset import DataSet
from jobs.plan.page import Page
from jobs.plan.plan import plan
from jobs.plan.task import STAGES, Stage, Task
from jobs.recipe.load import load_recipe
from jobs.run.executor import RunSummary, execute
from jobs.run.ledger import Ledger
from jobs.run.manifest_file import ManifestFile
from jobs.terminal import duration, number, print_lines, print_table
from jobs.verbs.parameters import NOTHING, ON, OUT, Add, On, Out, RecipeName, WorkerFlags
from weaves.errors import BadInput, WorkFailed

Share = Annotated[str, Parameter(help="Do this share of the tasks alone, such as 17/1000; needs no scheduler.")]


class Part(NamedTuple):
    """Part `number` of `parts`, 1 <= number <= parts: 17/1000 has the tasks at the places 17, 1017, 2017, … of a plan.

    The plan is the same everywhere, so each task is in exactly one of the thousand parts, whatever is done already.
    """

    number: int
    parts: int

    @classmethod
    def read(cls, text: str) -> Part:
        """Return the part of a text such as ``17/1000``; BadInput if it names none."""
        match = re.fullmatch(r"([1-9][0-9]{0,8})/([1-9][0-9]{0,8})", text)
        if match is None or int(match[1]) > int(match[2]):
            raise BadInput("--part", "", text, "must be a number, a slash and the number of parts: 1/1000 to 1000/1000")
        return cls(int(match[1]), int(match[2]))

    def of(self, tasks: Sequence[Task], stage: Stage) -> list[Task]:
        """Return the tasks of the part, from all tasks of a plan.

        A task that measures time needs a machine of its own, and one that needs another of its stage must wait for it:
        they are in no part.
        """
        own = {task.id: task for task in tasks if task.stage == stage}
        divisible = [task for task in own.values() if task.slots == "one" and own.keys().isdisjoint(task.needs)]
        return divisible[self.number - 1 :: self.parts]


def _divisible(stage: Stage) -> Callable[..., None]:
    def verb(recipe: RecipeName, *, part: Share = "", add: Add = NOTHING, out: Out = OUT, on: On = ON) -> None:
        if part:
            _work_part(recipe, stage, Part.read(part), out, on, add)
        else:
            work(recipe, [stage], out, on, add)

    return verb


generate, train, bench = map(_divisible, STAGES[:3])


def report(recipe: RecipeName, *, add: Add = NOTHING, out: Out = OUT, on: On = ON) -> None:
    """Write the page of a recipe; errors as for `work`."""
    work(recipe, ["report"], out, on, add)


def run(recipe: RecipeName, *, add: Add = NOTHING, out: Out = OUT, on: On = ON) -> None:
    """Do all stages of a recipe; errors as for `work`."""
    work(recipe, STAGES, out, on, add)


def work(recipe_name: str, stages: Sequence[Stage], out: Path, on: WorkerFlags, add: Sequence[str] = ()) -> None:
    """Run the unfinished tasks of some stages of a recipe and print a summary; `add`: methods from outside.

    BadInput if the recipe, the folder or the scheduler cannot be used; WorkFailed, at the end, if any task failed.
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
            scheduler=on.scheduler,
            workers=on.workers,
            manifests=manifests,
            progress=on.progress,
        )
    _print_summary([task for task in tasks if task.stage in stages], summary, ledger)
    if "report" in stages and ledger.state(page) == "done":
        print_lines("")
        _print_methods([out / path for path in page.records])
        print_lines("", f"the page: {(out / page.products[0]).resolve()}")
    _refuse_failed(recipe_name, summary, ledger, add)


def _work_part(recipe_name: str, stage: Stage, part: Part, out: Path, on: WorkerFlags, add: Sequence[str] = ()) -> None:
    """Run a part of the unfinished tasks of a stage in this process and print a summary; arguments as for `work`."""
    if replace(on, progress=ON.progress) != ON:
        allowed = "is done by one process without a scheduler: leave --workers, --scheduler and --tls-… out"
        raise BadInput("--part", "", f"{part.number}/{part.parts}", allowed)
    recipe = load_recipe(recipe_name, add)
    tasks, ledger = plan(recipe), Ledger(out)
    own = part.of(tasks, stage)
    needs = {need for task in own for need in task.needs}
    with ledger.store.held(shared=True):
        for file in (ManifestFile(DataSet(member), ledger) for member in recipe.together if needs):
            if not file.is_written():
                where = file.folder.relative_to(out)
                raise WorkFailed(f"{where}: its manifest lacks shards; run `twillight generate` without --part first")
        given = [task for task in tasks if task.id in needs]
        summary = execute([*given, *own], ledger, stages=[stage], serial=True, progress=on.progress)
    _print_summary(own, summary, ledger)
    _refuse_failed(recipe_name, summary, ledger, add)
    print_lines(f"when all {part.parts:,} parts are done: `twillight {stage} {recipe_name}` without --part")


def _print_summary(tasks: Sequence[Task], summary: RunSummary, ledger: Ledger) -> None:
    """Print some tasks by stage, how many of them a run did, and the seconds of work in them."""
    if not summary.ran and not summary.failed:
        print_lines(f"nothing to do: {len(tasks)} tasks done" if tasks else "nothing to do: no task is in this part")
        return
    ran, rows = {task.id: ledger.seconds(task) for task in summary.ran}, []
    for stage in STAGES:
        if ids := [task.id for task in tasks if task.stage == stage]:
            now = [ran[key] for key in ids if key in ran]
            rows.append((stage, len(ids), len(now), duration(sum(now)) if now else ""))
    print_table(("stage", "tasks", "done now", "work"), rows)


def _refuse_failed(recipe_name: str, summary: RunSummary, ledger: Ledger, add: Sequence[str]) -> None:
    if summary.failed:
        first, *others = summary.failed
        flags = "".join(f" --add {source}" for source in add)
        more = f"; {len(others)} more failed" if others else ""
        waiting = f"; {len(summary.waiting)} tasks wait for what failed" if summary.waiting else ""
        reason = f"{first.title}: {ledger.reason(first)}{more}{waiting}"
        raise WorkFailed(f"{reason}; see `twillight status {recipe_name}{flags}`")


def _withdraw(page: Page, tasks: Sequence[Task], ledger: Ledger) -> None:
    """Remove a finished page if times that it shows will be measured again: they will not be the same."""
    timed = [task for task in tasks if task.slots == "all" and task.id in page.needs]
    if ledger.state(page) == "done" and any(ledger.state(task) != "done" for task in timed):
        ledger.store.remove(page.products[0])


def _print_methods(records: Sequence[Path]) -> None:
    """Print a benchmark condensed to one row a method, without bytes, so that a line fits a terminal of 80 columns."""
    from reports.record import read_records
    from reports.tables.number_format import NO_BREAK
    from reports.tables.summary import summary_table

    frame = summary_table(read_records(records))
    frame = frame.drop(columns="bytes", errors="ignore").rename(columns={"ns/query": "ns a query"})
    rows = []
    for (method, setting), *values in frame.itertuples():
        rows.append((f"{method} {setting}".strip().replace(" ", NO_BREAK), *map(number, values)))
    print_table(("method", *frame.columns), rows, gap=1)
