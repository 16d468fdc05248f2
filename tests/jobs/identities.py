"""Identities of tasks by their stages and titles, and which of them an edit changes."""

import re

LEARNT = "^train|latents|extremes of (woven|neumip)|errors|noise|timing|^report"
"""Tasks of the recipe `tiny` that depend on its training rows; measurements on test rows name the whole data set."""


def ids(tasks, pattern=""):
    """Return the ids of the tasks whose stage and title match a pattern, in their order."""
    return {name: task.id for task in tasks if re.search(pattern, name := f"{task.stage} {task.title}")}


def assert_changed(before, after, pattern):
    """Assert that of the tasks in both plans exactly those have another id whose stage and title match a pattern."""
    old, new = ids(before), ids(after)
    same = old.keys() & new.keys()
    assert {name for name in same if old[name] != new[name]} == {name for name in same if re.search(pattern, name)}
