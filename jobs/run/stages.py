"""The function that does a task in a worker process."""

from __future__ import annotations

from pathlib import Path

from jobs.plan.task import Progress, Task


def run(task: Task, out: Path, progress: Progress) -> None:
    """Do a task; its products then lie in `out`."""
    task.run(out, progress)
