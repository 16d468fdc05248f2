"""A model at its extremes: sizes, angles, places, precisions."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from jobs.plan.measurements.measurement import Measurement
from jobs.plan.measurements.subjects import FabricSubject, Subjects, Trained
from jobs.plan.task import Progress, Uncoloured
from pipeline import versions
from pipeline.models.domain import PHYSICS
from pipeline.truth.options import TruthOptions
from reports.options import EXTREME_PRECISIONS, EXTREME_TRUTH, Role

if TYPE_CHECKING:
    from reports.record import Record


class Extremes(Measurement):
    """All methods of a model at their extremes, trained ones in half precision too."""

    kind: Literal["extremes"] = "extremes"
    model: Trained
    """The model."""
    fabrics: tuple[tuple[Uncoloured, Role], ...]
    """One fabric of each role."""
    truth: TruthOptions
    """The recipe's physics, at a fixed precision."""

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        """Yield one a model and seed, on the first fabric of each role that it answers for."""
        physics = {name: getattr(subjects.recipe.dataset.truth, name) for name in PHYSICS}
        for model in subjects.models:
            known: dict[Role, FabricSubject] = {}
            for subject in subjects.fabrics:
                if model.on([subject.fabric.name]):
                    known.setdefault(subject.role, subject)
            if trained := model.on([one.fabric.name for one in known.values()]) if known else None:
                yield cls(
                    model=trained,
                    fabrics=tuple((one.fabric, role) for role, one in known.items()),
                    truth=EXTREME_TRUTH.model_copy(update=physics),
                )

    @property
    def group(self) -> str:
        """Name of the model."""
        return self.model.options.name

    @property
    def title(self) -> str:
        """Model."""
        return f"extremes of {self.model.title}"

    @property
    def name(self) -> str:
        """Beginning of the names of its files."""
        return f"extremes-{self.model.options.name}"

    @property
    def trained(self) -> tuple[Trained, ...]:
        """The model."""
        return (self.model,)

    @property
    def needs(self) -> tuple[str, ...]:
        """The trainings."""
        return self.model.needs

    @property
    def cost(self) -> float:
        """Estimated seconds on one core."""
        return 3.0

    @property
    def size(self) -> int:
        """Estimated bytes."""
        return 6000

    def versions(self) -> dict[str, int]:
        """Return the versions of the truth, the model and these measurements."""
        return {"truth": versions.TRUTH, "extremes": versions.EXTREMES, "model": self.model.options.version}

    def measure(self, out: Path, progress: Progress) -> list[Record]:
        """Measure all methods side by side."""
        from pipeline.models.added.guarded import unchecked
        from pipeline.models.runtimes import runs
        from reports.measure.extremes import lustrous, measure_extremes

        fabrics = list(self.fabrics)
        if not self.model.options.of_one_material:
            fabrics.append((lustrous(fabrics[0][0]), "unseen"))
        precisions = EXTREME_PRECISIONS if self.model.networks else ()
        families = [[unchecked(one), *runs(one, precisions)] for one in self.model.methods(out)]
        return measure_extremes(families, fabrics, self.model.provenance(), self.truth)
