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
from weaves.errors import WorkFailed

if TYPE_CHECKING:
    from reports.record import Record

_SECONDS: Final[dict[StudyName, float]] = {
    "stability": 60.0,
    "throughput": 60.0,
    "accuracy": 60.0,
    "calibration": 60.0,
    "bias": 60.0,
    "effort": 60.0,
    "footprint_colours": 60.0,
    "sampling": 60.0,
    "path_traced": 60.0,
}
"""Estimated seconds on one core."""

_UNTIMED: Final[tuple[StudyName, ...]] = ("stability", "calibration", "bias", "path_traced")


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
    def slots(self) -> Literal["one", "all"]:
        """All where times are among the results."""
        return "one" if self.study in _UNTIMED else "all"

    @property
    def cost(self) -> float:
        """Estimated seconds on one core."""
        return _SECONDS[self.study]

    def measure(self, out: Path, progress: Progress) -> list[Record]:
        """Measure it.

        Raises
        ------
        BadInput
            If Mitsuba is not installed.
        WorkFailed
            If an expression of `stability` exceeds its limit.
        """
        if self.study == "stability":
            return _stability()
        module = import_module(f"reports.truth.{self.study}")
        records: list[Record] = module.RECORDS.to_records(list(module.measure()))
        return records


def _stability() -> list[Record]:
    from reports.truth.finding import RECORDS, failures
    from reports.truth.stability import stability

    findings = stability()
    if wrong := failures(findings):
        first, more = wrong[0], f"; {len(wrong) - 1} more do not hold" if len(wrong) > 1 else ""
        raise WorkFailed(f"{first.expression} in {first.arithmetic}, {first.corner}: {first.fault} at {first.at}{more}")
    return RECORDS.to_records(findings)
