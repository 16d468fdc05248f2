"""Studies: measurements of the truth, of importance sampling and of Mitsuba's frames, with subjects of their own."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Final, Literal

from jobs.plan.measurements.measurement import Measurement
from jobs.plan.measurements.subjects import Subjects
from jobs.plan.task import Progress
from reports.options import StudyName

if TYPE_CHECKING:
    from reports.record import Record

_UNTIMED: Final[tuple[StudyName, ...]] = ("stability", "calibration", "bias", "path_traced", "measured_cloth")
_LONG: Final[dict[StudyName, float]] = {"calibration": 400.0, "bias": 170.0, "sampling": 170.0, "measured_cloth": 840.0}


class Study(Measurement):
    """A module of `reports.truth`: all that its ``measure`` yields becomes Records; no data set is read."""

    kind: Literal["study"] = "study"
    code: ClassVar = ("truth", "bench")
    study: StudyName
    """Name of the module."""

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        """Yield those that the recipe names."""
        for name in subjects.recipe.bench.studies:
            yield cls(study=name)

    @property
    def cost(self) -> float:
        """Estimated seconds on one core."""
        return _LONG.get(self.study, 40.0)

    @property
    def slots(self) -> Literal["one", "all"]:
        """All where times are among the results."""
        return "one" if self.study in _UNTIMED else "all"

    def measure(self, out: Path, progress: Progress) -> list[Record]:
        """Measure it.

        BadInput if Mitsuba is not installed; WorkFailed if an expression of `stability` exceeds its limit.
        """
        module = import_module(f"reports.truth.{self.study}")
        records: list[Record] = module.RECORDS.to_records(module.measure())
        return records
