"""Part: a share of the tasks of a stage for one of several processes that know nothing of each other.

Part 17/1000 has the tasks at the places 17, 1017, 2017, … of the plan. The plan is the same everywhere, so each task is
in exactly one of the thousand parts, whatever is done already.

    example   7 tasks, 3 parts: (1 4 7), (2 5), (3 6)
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final, NamedTuple

from jobs.plan.task import Stage, Task
from weaves.errors import BadInput

_FORM: Final = re.compile(r"([1-9][0-9]{0,8})/([1-9][0-9]{0,8})")


class Part(NamedTuple):
    """Part `number` of `parts`, 1 <= number <= parts."""

    number: int
    parts: int

    @classmethod
    def read(cls, text: str) -> Part:
        """Return the part of a text such as ``17/1000``; BadInput if it names none."""
        match = _FORM.fullmatch(text)
        if match is None or int(match[1]) > int(match[2]):
            raise BadInput("--part", "", text, "must be a number, a slash and the number of parts: 1/1000 to 1000/1000")
        return cls(int(match[1]), int(match[2]))

    def of(self, tasks: Sequence[Task], stage: Stage) -> list[Task]:
        """Return the tasks of the part, from all tasks of a plan.

        A task that measures time needs a machine of its own, and one that needs another of its stage must wait for it:
        they are in no part.
        """
        own = {task.id: task for task in tasks if task.stage == stage}
        divisible = [task for task in own.values() if task.slots == "one" and own.keys().isdisjoint(task.needs)]
        return divisible[self.number - 1 :: self.parts]
