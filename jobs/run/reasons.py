"""Reasons why tasks of a plan would run: never made, failed, damaged, or which part of their identity has changed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from jobs.plan.task import Task
from jobs.run.ledger import Ledger
from jobs.run.receipt import Receipt

NEVER_MADE: Final = "never made"
"""Reason of a task that has no predecessor."""

ELSEWHERE: Final = "taken from another data set"
"""Reason of a task that need not run: its products are in another data set, and a run links them."""

CHANGED: Final = "changed: "
"""Beginning of the reason of a task that was made before with another identity."""

_MOST_KEYS: Final = 3  # that a reason names


def reasons(tasks: Sequence[Task], ledger: Ledger) -> dict[str, str]:
    """Return why each task that is not done would run, by its id.

    The predecessor of a task is the finished task of the same stage and title whose identity is most like its own.
    """
    states = {task.id: ledger.state(task) for task in tasks}
    left = {(task.stage, task.title): task for task in tasks if states[task.id] != "done"}
    before: dict[tuple[str, str], list[Receipt]] = {key: [] for key in left}
    for receipt in ledger.receipts(states) if left else ():
        if (receipt.stage, receipt.title) in left:
            before[receipt.stage, receipt.title].append(receipt)
    why = {}
    for key, task in left.items():
        if states[task.id] == "failed":
            why[task.id] = f"failed: {ledger.reason(task)}"
        elif ledger.is_elsewhere(task):
            why[task.id] = ELSEWHERE
        elif ledger.receipt(task):
            why[task.id] = "a product is missing or damaged"
        else:
            why[task.id] = _changed(task, before[key])
    return why


def _changed(task: Task, before: Sequence[Receipt]) -> str:
    """Return which keys are not those of the most similar predecessor."""
    if not before:
        return NEVER_MADE
    now = Receipt.of(task, {}, 0.0)
    lists = [receipt.changes(now) for receipt in before if receipt.identity]
    if not lists:
        return "made before; its receipt does not say from what"
    changes = min(lists, key=len)
    more = f" and {len(changes) - _MOST_KEYS} more" if len(changes) > _MOST_KEYS else ""
    return f"{CHANGED}{', '.join(changes[:_MOST_KEYS])}{more}"
