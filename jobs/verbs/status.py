"""`twillight status`: done, failed and missing tasks, with the reasons of failures."""

from __future__ import annotations

from collections.abc import Sequence

from rich.table import Table

from jobs.console import table_of
from jobs.plan.plan import plan
from jobs.plan.task import STAGES, Task
from jobs.recipe.load import load_recipe
from jobs.run.ledger import Ledger
from jobs.terminal import Terminal
from jobs.verbs.parameters import NOTHING, OUT, Add, Out, RecipeName


def print_status(recipe: RecipeName, *, add: Add = NOTHING, out: Out = OUT) -> None:
    """Print the states of a recipe's tasks."""
    Terminal().print(status_table(plan(load_recipe(recipe, add)), Ledger(out)))


def status_table(tasks: Sequence[Task], ledger: Ledger) -> Table:
    """Show done, failed and missing tasks by stage, and the reason of each failure."""
    table = table_of("stage", "done", "failed", "missing", right=("done", "failed", "missing"))
    states = {task.id: ledger.state(task) for task in tasks}
    for stage in STAGES:
        found = [states[task.id] for task in tasks if task.stage == stage]
        if found:
            table.add_row(stage, *(str(found.count(state)) for state in ("done", "failed", "missing")))
    failed = [f"{task.title}: {ledger.reason(task)}" for task in tasks if states[task.id] == "failed"]
    table.caption = "\n".join(failed) or None
    return table
