"""`twillight plan`: the tasks of a recipe with their rows, bytes and estimated time."""

from __future__ import annotations

import os
from collections.abc import Sequence

from rich.table import Table

from jobs.console import duration, size, table_of
from jobs.plan.plan import plan
from jobs.plan.task import STAGES, Task, urgencies
from jobs.recipe.load import load_recipe
from jobs.terminal import Terminal


def print_plan(recipe: str) -> None:
    """Print the plan of a recipe; nothing is computed."""
    Terminal().print(plan_table(plan(load_recipe(recipe))))


def plan_table(tasks: Sequence[Task]) -> Table:
    """Show a plan: tasks, rows, bytes and time on one core, by stage and kind, with totals."""
    table = table_of("stage", "what", "tasks", "rows", "size", "one core", right=("tasks", "rows", "size", "one core"))
    for stage in STAGES:
        groups: dict[str, list[Task]] = {}
        for task in tasks:
            if task.stage == stage:
                groups.setdefault(task.group, []).append(task)
        for group, members in groups.items():
            table.add_row(stage, group, *_sums(members))
        table.add_section()
    table.add_row("all", "", *_sums(tasks))
    cores = os.cpu_count() or 1
    seconds = max(sum(task.cost for task in tasks) / cores, *urgencies(tasks).values(), 0.0)
    table.caption = f"about {duration(seconds)} on the {cores} cores of this machine"
    return table


def _sums(tasks: Sequence[Task]) -> tuple[str, str, str, str]:
    rows, bytes_ = sum(task.rows for task in tasks), sum(task.size for task in tasks)
    return (
        f"{len(tasks):,}",
        f"{rows:,}" if rows else "",
        size(bytes_) if bytes_ else "",
        duration(sum(task.cost for task in tasks)),
    )
