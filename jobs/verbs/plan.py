"""`twillight plan` and `twillight status`: what would run and why, with rows and time; what is done and what failed."""

import math
from collections.abc import Iterator, Sequence
from typing import Annotated, Final, NamedTuple

from cyclopts import Parameter

from jobs.plan.plan import plan
from jobs.plan.ready import chains
from jobs.plan.schedule import LEAST_GAIN, Estimate, Schedule, doublings
from jobs.plan.task import STAGES, Task
from jobs.recipe.load import load_recipe
from jobs.run.ledger import ELSEWHERE, Ledger, reasons
from jobs.terminal import duration, print_lines, print_table
from jobs.verbs.parameters import NOTHING, OUT, Add, Out, RecipeName, Whole
from pipeline.cores import cores
from weaves.errors import BadInput

_MOST_WORKERS: Final = 100_000  # of a simulated schedule


class Facts(NamedTuple):
    """Knowledge of the ledger about a plan."""

    why: dict[str, str]  # why each task that is not done would run, by its id
    seconds: dict[str, float]
    """Duration of every task: measured, or estimated and scaled by what was measured of its kind."""
    measured: int  # number of tasks with a measured duration

    def left(self, tasks: Sequence[Task]) -> list[Task]:
        """Return the tasks that would run."""
        return [task for task in tasks if self.why.get(task.id, ELSEWHERE) != ELSEWHERE]


def print_status(recipe: RecipeName, *, add: Add = NOTHING, out: Out = OUT) -> None:
    """Print how many tasks of each stage are done, failed and missing, and the reason of each failure."""
    tasks, ledger = plan(load_recipe(recipe, add)), Ledger(out)
    states = {task.id: ledger.state(task) for task in tasks}
    parts = ((stage, [states[task.id] for task in tasks if task.stage == stage]) for stage in STAGES)
    rows = [(stage, *(part.count(state) for state in ("done", "failed", "missing"))) for stage, part in parts if part]
    failed = [f"{task.title}: {ledger.reason(task)}" for task in tasks if states[task.id] == "failed"]
    print_table(("stage", "done", "failed", "missing"), rows, caption="\n".join(failed))


def print_plan(
    recipe: RecipeName,
    *,
    add: Add = NOTHING,
    out: Out = OUT,
    workers: Annotated[Whole, Parameter(help="Show how long so many workers take, and where it stops scaling.")] = 0,
    price: Annotated[float, Parameter(help="Price of a core-hour: show what the work that is left costs.")] = 0.0,
) -> None:
    """Print the plan of a recipe; nothing is computed. BadInput if the recipe, workers or price cannot be used."""
    if not 0 <= workers <= _MOST_WORKERS:
        raise BadInput("--workers", "", workers, f"must be from 1 to {_MOST_WORKERS}")
    if not 0 <= price < math.inf:
        raise BadInput("--price", "", price, "must be at least 0")
    tasks = plan(load_recipe(recipe, add))
    facts = facts_of(tasks, Ledger(out))
    _print_plan(tasks, facts)
    print_lines(*_details(tasks, facts))
    if price:
        hours = sum(facts.seconds[task.id] for task in facts.left(tasks)) / 3600
        print_lines(f"to do: {hours:,.2f} core-hours, {hours * price:,.2f} at {price:g} each")
    if workers:
        print_lines("")
        _print_schedule(tasks, facts, workers)


def facts_of(tasks: Sequence[Task], ledger: Ledger) -> Facts:
    """Read what the ledger knows of a plan."""
    receipts = {task.id: ledger.receipt(task) for task in tasks}
    measured = {task: receipt.seconds for task, receipt in receipts.items() if receipt}
    estimate = Estimate()
    for task in tasks:
        if task.id in measured:
            estimate.learn(task, measured[task.id])
    seconds = {task.id: measured[task.id] if task.id in measured else estimate.seconds(task) for task in tasks}
    return Facts(reasons(tasks, ledger), seconds, len(measured))


def _print_plan(tasks: Sequence[Task], facts: Facts) -> None:
    """Print a plan by stage, kind and reason: tasks, rows and time on one core; totals of what would run."""
    groups: dict[tuple[str, str, str], list[Task]] = {}
    for task in tasks:
        why, _, _ = facts.why.get(task.id, "done").partition(":")
        groups.setdefault((task.stage, task.group, why), []).append(task)
    rows = [
        (stage, group, *_sums(members, facts), why)
        for (stage, group, why), members in sorted(groups.items(), key=lambda item: STAGES.index(item[1][0].stage))
    ]
    left = facts.left(tasks)
    rows.append(("all", "", *_sums(tasks, facts), ""))
    if len(left) < len(tasks):
        rows.append(("to do", "", *_sums(left, facts), ""))
    seconds = Schedule.of(left, facts.seconds, cores()).makespan
    caption = f"about {duration(seconds)} on the {cores()} cores of this machine" if left else "nothing to do"
    dim = {index: "dim" for index, row in enumerate(rows) if row[-1] == "done"}
    columns = ("stage", "what", "tasks", "rows", "one core", "why")
    print_table(columns, rows, text=("what", "why"), caption=caption, styles=dim)


def _details(tasks: Sequence[Task], facts: Facts) -> Iterator[str]:
    """Yield each reason that names keys or a failure once, with the tasks that it holds for."""
    by_reason: dict[str, list[Task]] = {}
    for task in tasks:
        if ":" in (why := facts.why.get(task.id, "")):
            by_reason.setdefault(why, []).append(task)
    for why, (first, *others) in by_reason.items():
        more = f" and {len(others)} more" if others else ""
        yield f"{first.stage} {first.title}{more}: {why}"


def _print_schedule(tasks: Sequence[Task], facts: Facts, workers: int) -> None:
    """Print how long the whole plan, and what is left of it, takes on 1, 2, 4, … workers, and on the wished number."""
    left = facts.left(tasks)
    schedules = {schedule.workers: schedule for schedule in doublings(tasks, facts.seconds)}
    last = max(schedules)
    chosen = schedules[workers] = Schedule.of(tasks, facts.seconds, workers)
    rows = []
    for count, schedule in sorted(schedules.items()):
        rest = duration(Schedule.of(left, facts.seconds, count).makespan)
        whole, tail = duration(schedule.makespan), duration(schedule.tail)
        rows.append((f"{count:,}", whole, rest, f"{schedule.efficiency:.0%}", tail))
    notes = (
        f"{workers:,} workers: {duration(chosen.makespan)}, of which the last {duration(chosen.tail)} with idle "
        "workers (tail)",
        f"more than {max(1, last // 2):,} workers save less than {LEAST_GAIN:.0%} each time they double; the longest "
        f"chain of tasks takes {duration(max(chains(tasks, facts.seconds).values(), default=0.0))}",
        f"{facts.measured:,} of {len(tasks):,} durations are measured, the others estimated",
    )
    bold = {sorted(schedules).index(workers): "bold"}
    print_table(("workers", "everything", "to do", "busy", "tail"), rows, caption="\n".join(notes), styles=bold)


def _sums(tasks: Sequence[Task], facts: Facts) -> tuple[str, str, str]:
    """Return the number of tasks, their rows, and their time on one core."""
    rows = sum(task.rows for task in tasks)
    seconds = sum(facts.seconds[task.id] for task in tasks)
    return f"{len(tasks):,}", f"{rows:,}" if rows else "", duration(seconds)
