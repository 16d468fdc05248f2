"""Tasks one after the other in this process, in place of a crew of workers: no scheduler and no port.

Tasks that measure time and code from outside have processes of their own, as always (`jobs.run.outcome`).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from typing import Any, ClassVar, Final

from jobs.plan.task import Task
from jobs.run.compiling import KernelGroup
from jobs.run.ledger import Ledger
from jobs.run.outcome import Outcome, work

_HERE: Final = "this process"


class Serial:
    """A crew of this process alone, with the interface of `jobs.run.crew.Crew`; `hear` receives the same messages.

    Other processes may be at work in the output folder: a task that one of them is at is waited for, and taken from it.
    """

    slots: ClassVar[int] = 1
    dashboard: ClassVar[str | None] = None

    def __init__(self, ledger: Ledger, hear: Callable[[Mapping[str, Any]], None]) -> None:
        self._ledger, self._hear = ledger, hear
        self._next: list[tuple[Task, Mapping[str, str]]] = []
        self.accepted = [_HERE]

    def look(self) -> None:
        """Do nothing: no worker comes or goes."""

    def recheck(self, address: str) -> None:
        """Do nothing: its software is the driver's."""

    def compile(self, groups: Sequence[KernelGroup], show: Callable[[int, Iterable[str]], None]) -> None:
        """Compile groups of kernels; a failure here occurs again in the task that needs the kernel."""
        for done, group in enumerate(groups):
            show(done, [group.name])
            with suppress(Exception):
                group.compile(lambda kernel: self._hear({"kernel": kernel}))
        if groups:
            show(len(groups), ())

    def start(self, task: Task, out: str, inputs: Mapping[str, str], avoided: Collection[str] = ()) -> None:
        """Take a task that `ended` does; arguments as for a crew, and the folder is that of the ledger."""
        self._next.append((task, inputs))

    def ended(self, seconds: float) -> list[tuple[Task, Outcome]]:
        """Do the task that was started, and return it with its outcome."""
        task, inputs = self._next.pop()
        with self._ledger.store.claimed(task.id):
            if receipt := self._ledger.done(task):
                return [(task, Outcome(receipt.files, receipt.seconds))]
            hear = self._hear
            return [(task, work(task, self._ledger.out, lambda share: hear({"task": task.id, "share": share}), inputs))]
