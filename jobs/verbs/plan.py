"""`twillight plan`: what would run and why, with rows and time; and how long it takes on some workers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Final, NamedTuple

from cyclopts import Parameter
from rich.table import Table

from jobs.console import duration, table_of
from jobs.plan.estimate import Estimate
from jobs.plan.plan import plan
from jobs.plan.schedule import LEAST_GAIN, Schedule, doublings, longest_chain, schedule
from jobs.plan.task import STAGES, Task
from jobs.recipe.load import load_recipe
from jobs.run.ledger import Ledger
from jobs.run.reasons import ELSEWHERE, reasons
from jobs.terminal import Terminal
from jobs.verbs.parameters import NOTHING, OUT, Add, Out, RecipeName
from pipeline.cores import cores
from weaves.errors import BadInput

MOST_WORKERS: Final = 100_000
"""Workers of a simulated schedule, at most."""


class Facts(NamedTuple):
    """Knowledge of the ledger about a plan.

    Attributes
    ----------
    why : dict
        Why each task that is not done would run, by its id.
    seconds : dict
        Duration of every task: measured, or estimated and scaled by what was measured of its kind.
    measured : int
        Number of tasks with a measured duration.
    """

    why: dict[str, str]
    seconds: dict[str, float]
    measured: int

    def left(self, tasks: Sequence[Task]) -> list[Task]:
        """Return the tasks that would run."""
        return [task for task in tasks if self.why.get(task.id, ELSEWHERE) != ELSEWHERE]


def print_plan(
    recipe: RecipeName,
    *,
    add: Add = NOTHING,
    out: Out = OUT,
    workers: Annotated[int, Parameter(help="Show how long so many workers take, and where it stops scaling.")] = 0,
) -> None:
    """Print the plan of a recipe; nothing is computed.

    Raises
    ------
    BadInput
        If the recipe or the number of workers cannot be used.
    """
    if not 0 <= workers <= MOST_WORKERS:
        raise BadInput("--workers", "", workers, f"must be from 1 to {MOST_WORKERS}")
    tasks = plan(load_recipe(recipe, add))
    facts = facts_of(tasks, Ledger(out))
    console = Terminal()
    console.print(plan_table(tasks, facts))
    for line in details(tasks, facts):
        console.print(line, soft_wrap=True)
    if workers:
        console.print()
        console.print(schedule_table(tasks, facts, workers))


def facts_of(tasks: Sequence[Task], ledger: Ledger) -> Facts:
    """Read what the ledger knows of a plan."""
    why = reasons(tasks, ledger)
    receipts = {task.id: ledger.receipt(task) for task in tasks}
    measured = {id: receipt for id, receipt in receipts.items() if receipt}
    estimate = Estimate()
    for task in tasks:
        if receipt := measured.get(task.id):
            estimate.learn(task, receipt.seconds)
    seconds = {}
    for task in tasks:
        if receipt := measured.get(task.id):
            seconds[task.id] = receipt.seconds
        else:
            seconds[task.id] = estimate.seconds(task)
    return Facts(why, seconds, len(measured))


def plan_table(tasks: Sequence[Task], facts: Facts) -> Table:
    """Show a plan by stage, kind and reason: tasks, rows and time on one core; totals of what would run."""
    right = ("tasks", "rows", "one core")
    table = table_of("stage", "what", *right, "why", right=right)
    for stage in STAGES:
        groups: dict[tuple[str, str], list[Task]] = {}
        for task in tasks:
            if task.stage == stage:
                why, _, _ = facts.why.get(task.id, "done").partition(":")
                groups.setdefault((task.group, why), []).append(task)
        for (group, why), members in groups.items():
            table.add_row(stage, group, *_sums(members, facts), why, style="dim" if why == "done" else "")
        table.add_section()
    left = facts.left(tasks)
    table.add_row("all", "", *_sums(tasks, facts), "")
    if len(left) < len(tasks):
        table.add_row("to do", "", *_sums(left, facts), "")
    there = f"on the {cores()} cores of this machine"
    seconds = schedule(left, facts.seconds, cores()).makespan
    table.caption = f"about {duration(seconds)} {there}" if left else "nothing to do"
    return table


def details(tasks: Sequence[Task], facts: Facts) -> list[str]:
    """Return each reason that names keys or a failure once, with the tasks that it holds for."""
    found: dict[str, list[Task]] = {}
    for task in tasks:
        if ":" in (why := facts.why.get(task.id, "")):
            found.setdefault(why, []).append(task)
    lines = []
    for why, members in found.items():
        first, more = members[0], f" and {len(members) - 1} more" if len(members) > 1 else ""
        lines.append(f"{first.stage} {first.title}{more}: {why}")
    return lines


def schedule_table(tasks: Sequence[Task], facts: Facts, workers: int) -> Table:
    """Show how long the whole plan, and what is left of it, takes on 1, 2, 4, … workers, and on the wished number."""
    left = facts.left(tasks)
    found = {one.workers: one for one in doublings(tasks, facts.seconds)}
    last = max(found)
    found[workers] = schedule(tasks, facts.seconds, workers)
    right = ("workers", "everything", "to do", "busy", "tail")
    table = table_of(*right, right=right)
    for count, one in sorted(found.items()):
        rest = schedule(left, facts.seconds, count)
        style = "bold" if count == workers else ""
        cells = duration(one.makespan), duration(rest.makespan), f"{one.efficiency:.0%}", duration(one.tail)
        table.add_row(f"{count:,}", *cells, style=style)
    table.caption = "\n".join(_notes(tasks, facts, found[workers], last))
    return table


def _notes(tasks: Sequence[Task], facts: Facts, chosen: Schedule, last: int) -> list[str]:
    """Return sentences about a schedule: straggler tail, where it stops scaling, and what was measured."""
    chain = longest_chain(tasks, facts.seconds)
    return [
        f"{chosen.workers:,} workers: {duration(chosen.makespan)}, of which the last {duration(chosen.tail)} with idle "
        "workers (tail)",
        f"more than {max(1, last // 2):,} workers save less than {LEAST_GAIN:.0%} each time they double; the longest "
        f"chain of tasks takes {duration(chain)}",
        f"{facts.measured:,} of {len(tasks):,} durations are measured, the others estimated",
    ]


def _sums(tasks: Sequence[Task], facts: Facts) -> tuple[str, str, str]:
    rows = sum(task.rows for task in tasks)
    return (
        f"{len(tasks):,}",
        f"{rows:,}" if rows else "",
        duration(sum(facts.seconds[task.id] for task in tasks)),
    )
