"""Task: one piece of work, known by what it computes and not by its rank.

The id is the fingerprint of the stage and the specification, which holds the VERSIONs of the code at work. Where its
inputs lie (`setting`) and where its products go are no part of it: the same work asked for by another recipe, in
another order or on more workers is the same task.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Literal

from pipeline.fingerprint import fingerprint

Stage = Literal["generate", "train", "bench", "report"]

STAGES: Final[tuple[Stage, ...]] = ("generate", "train", "bench", "report")
"""The stages in the order of work; each is a verb of the command line."""


@dataclass(frozen=True)
class Task:
    """A piece of work and what is known of it before it runs; paths are relative to the output folder.

    Attributes
    ----------
    stage : str
        The stage that does it.
    group, title : str
        What a person calls tasks of its kind, and this one.
    spec : mapping
        JSON-able; everything that the products' bytes depend on, VERSIONs included.
    products : tuple of str
        Files that exist when it is done.
    needs : tuple of str
        Ids of the tasks that must be done before.
    cost : float
        Estimated seconds on one core.
    rows, size : int
        Estimated rows and bytes of the products.
    setting : mapping
        JSON-able; what else it needs to run, such as the folders to read or the device; no part of the identity.
    alone : bool
        It measures time, so that nothing else may run beside it.
    """

    stage: Stage
    group: str
    title: str
    spec: Mapping[str, Any]
    products: tuple[str, ...]
    needs: tuple[str, ...] = ()
    cost: float = 1.0
    rows: int = 0
    size: int = 0
    setting: Mapping[str, Any] = field(default_factory=dict)
    alone: bool = False
    id: str = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "id", identity(self.stage, self.spec))


def identity(stage: Stage, spec: Mapping[str, Any]) -> str:
    """Return the id of the task of a stage with this specification: 16 hexadecimal digits."""
    return fingerprint([stage, spec])


def urgencies(tasks: Sequence[Task]) -> dict[str, float]:
    """Return for each task the estimated seconds of the longest chain of tasks that starts with it.

    Taking the longest chain first is the classical list schedule [Graham1969Bounds].
    """
    after = dict.fromkeys((task.id for task in tasks), 0.0)
    chain = {}
    for task in reversed(tasks):  # a plan lists every task after those it needs
        chain[task.id] = task.cost + after[task.id]
        for need in after.keys() & set(task.needs):
            after[need] = max(after[need], chain[task.id])
    return chain
