"""Reasons why tasks of a plan would run: never made, failed, damaged, or which part of their identity has changed."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Final

from jobs.plan.task import Task
from jobs.run.ledger import Ledger
from jobs.run.receipt import Leaf, Receipt, leaves

NEVER: Final = "never made"
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
    before: dict[tuple[str, str], list[Receipt]] = {}
    if left:
        for receipt in ledger.receipts(states):
            if (receipt.stage, receipt.title) in left:
                before.setdefault((receipt.stage, receipt.title), []).append(receipt)
    found = {}
    for key, task in left.items():
        if states[task.id] == "failed":
            found[task.id] = f"failed: {ledger.reason(task)}"
        elif ledger.is_elsewhere(task):
            found[task.id] = ELSEWHERE
        elif ledger.receipt(task):
            found[task.id] = "a product is missing or damaged"
        else:
            found[task.id] = _changed(task, before.get(key, []))
    return found


def _changed(task: Task, before: Sequence[Receipt]) -> str:
    """Return which keys are not those of the most similar predecessor."""
    if not before:
        return NEVER
    known = [receipt.identity for receipt in before if receipt.identity]
    if not known:
        return "made before; its receipt does not say from what"
    now = leaves(task.identity())
    lists = [_differences(identity, now) for identity in known]
    changes = min(lists, key=len)
    more = f" and {len(changes) - _MOST_KEYS} more" if len(changes) > _MOST_KEYS else ""
    return f"{CHANGED}{', '.join(changes[:_MOST_KEYS])}{more}"


def _differences(before: Mapping[str, Leaf], now: Mapping[str, Leaf]) -> list[str]:
    """Return what differs between two identities: versions first, values where they are short."""
    keys = sorted(before.keys() | now.keys(), key=lambda key: ("version" not in key, key))
    return [_difference(key, before, now) for key in keys if before.get(key, _ABSENT) != now.get(key, _ABSENT)]


_ABSENT: Final = "–"
_HASH: Final = re.compile(r"\b[0-9a-f]{16}\b")


def _difference(key: str, before: Mapping[str, Leaf], now: Mapping[str, Leaf]) -> str:
    old, new = (str(values.get(key, _ABSENT)) for values in (before, now))
    hashed = any(value.startswith("#") or _HASH.search(value) for value in (old, new))
    return key if hashed else f"{key} {old} → {new}"
