"""Measurement: a task of the benchmark, its Records and its pictures."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from jobs.plan.measurements.subjects import Subjects
from jobs.plan.task import Progress, Stage, Task

if TYPE_CHECKING:
    from reports.record import Record


@dataclass(frozen=True)
class Picture:
    """A picture that a measurement writes."""

    fabric: str
    """Empty for a scene, which has cloths of its own."""
    scene: str
    """View of the fabric, or name of the scene."""
    method: str
    """``truth`` for the reference."""
    setting: str
    path: str
    """Relative to the output folder."""


class Measurement(Task):
    """A task of the benchmark; each kind has a field ``kind``."""

    stage: ClassVar[Stage] = "bench"

    if TYPE_CHECKING:

        @property
        def kind(self) -> str:
            """Name of the kind of measurement."""

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        """Yield all measurements of this kind that a recipe has."""
        raise NotImplementedError

    @property
    def name(self) -> str:
        """Beginning of the names of its files."""
        raise NotImplementedError

    @property
    def stem(self) -> str:
        """Path of its files without their endings."""
        return f"records/{self.name}-{self.id[:8]}"

    @property
    def records(self) -> str:
        """File of its Records; empty if it has none."""
        return f"{self.stem}.json"

    @property
    def pictures(self) -> tuple[Picture, ...]:
        """Pictures that it writes."""
        return ()

    @property
    def products(self) -> tuple[str, ...]:
        """Records, the machine they were measured on, pictures."""
        return (self.records, f"{self.stem}.machine.json", *(picture.path for picture in self.pictures))

    @property
    def threads(self) -> int:
        """Most threads that a method may use while it is measured."""
        return 1

    def run(self, out: Path, progress: Progress) -> None:
        """Measure, and write the Records."""
        from reports.record import this_machine, write_records

        records = self.measure(out, progress)
        write_records(out / self.records, records, this_machine(self.threads))

    def measure(self, out: Path, progress: Progress) -> list[Record]:
        """Return the Records; pictures are written."""
        raise NotImplementedError
