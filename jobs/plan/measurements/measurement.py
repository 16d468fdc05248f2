"""Measurement: a task of the benchmark, its Records and its pictures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, ClassVar, Self

from jobs.plan.measurements.subjects import Subjects, Trained
from jobs.plan.task import Progress, Stage, Task
from pipeline.models.added.added_method import AddedMethod

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

    @property
    def trained(self) -> tuple[Trained, ...]:
        """Models that it measures."""
        return ()

    @property
    def runs_added_code(self) -> bool:
        """True if code from outside is run."""
        return any(isinstance(one.options, AddedMethod) for one in self.trained)

    def without(self, names: Sequence[str]) -> Self | None:
        """Return the measurement without some methods from outside; None if it measures one model alone."""
        return None

    def run(self, out: Path, progress: Progress) -> None:
        """Measure, and write the Records; with methods from outside, in a process that can be ended.

        A method that fails ends a measurement of it alone. One of several methods starts again without it.

        Raises
        ------
        MethodFailed
            If the only method fails.
        """
        if not self.runs_added_code:
            self.write(out, progress)
            return
        from pipeline.models.added.apart import run_apart
        from pipeline.models.added.guarded import MethodFailed

        left_out: dict[str, str] = {}
        while True:
            try:
                return run_apart(_write, self, out, left_out, progress=progress)
            except MethodFailed as failure:
                if failure.name in left_out or self.without([failure.name]) is None:
                    raise
                left_out[failure.name] = failure.reason

    def write(self, out: Path, progress: Progress, left_out: Mapping[str, str] = MappingProxyType({})) -> None:
        """Measure, and write the Records.

        Parameters
        ----------
        out : Path
            Output folder.
        progress : callable
            Receives the finished share.
        left_out : mapping
            Methods from outside that failed in this measurement, each with the reason.
        """
        from reports.record import Record, this_machine, write_records

        measured = self.without(list(left_out)) if left_out else self
        assert measured is not None
        records = measured.measure(out, progress)
        records += [
            Record(method=name, scene=self.of_scene, metric="not_run", value=1.0, note=reason)
            for name, reason in left_out.items()
        ]
        origins = {one.options.name: one.options.origin for one in self.trained if isinstance(one.options, AddedMethod)}
        records = [one.made_by(origins[one.method]) if one.method in origins else one for one in records]
        write_records(out / self.records, records, this_machine(self.threads))

    @property
    def of_scene(self) -> str:
        """Name of the scene that it is about; empty if there is none."""
        return ""

    def measure(self, out: Path, progress: Progress) -> list[Record]:
        """Return the Records; pictures are written."""
        raise NotImplementedError


def _write(task: Measurement, out: Path, left_out: Mapping[str, str], progress: Progress) -> None:
    """Measure, and write the Records, in another process."""
    task.write(out, progress, left_out)
