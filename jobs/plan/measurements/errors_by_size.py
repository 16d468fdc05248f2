"""Errors by the size of footprints, of trainings after the first: those of the first are measured with its times."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from jobs.plan.measurements.measurement import Measurement
from jobs.plan.measurements.subjects import Dataset, Subjects, Trained
from jobs.plan.task import Progress
from pipeline import versions

if TYPE_CHECKING:
    from reports.record import Record


class ErrorsBySize(Measurement):
    """Errors of one training of a model by the size of footprints, on the held-out queries of all fabrics."""

    kind: Literal["errors by size"] = "errors by size"
    model: Trained
    """The model with the networks of all fabrics."""
    dataset: Dataset
    """The held-out queries of all fabrics."""
    seed: int
    """Seed of the points of random methods."""

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        """Yield one a model and seed after its first."""
        dataset = subjects.dataset([subject.fabric.name for subject in subjects.fabrics])
        for model in subjects.models:
            if not model.is_first:
                yield cls(model=model.whole, dataset=dataset, seed=subjects.recipe.bench.seed)

    @property
    def group(self) -> str:
        """Name of the model."""
        return self.model.options.name

    @property
    def title(self) -> str:
        """Model and seed."""
        return f"errors of {self.model.title} by size"

    @property
    def name(self) -> str:
        """Beginning of the names of its files."""
        return f"size-{self.model.options.name}"

    @property
    def trained(self) -> tuple[Trained, ...]:
        """The model."""
        return (self.model,)

    @property
    def needs(self) -> tuple[str, ...]:
        """Test rows and trainings."""
        return (*self.dataset.rows, *self.model.needs)

    @property
    def cost(self) -> float:
        """Estimated seconds on one core."""
        return 3.0

    @property
    def size(self) -> int:
        """Estimated bytes."""
        return 2000

    def versions(self) -> dict[str, int]:
        """Return the versions of the model and of the benchmark; that of the truth is in its inputs."""
        return {"bench": versions.BENCH, "model": self.model.options.version}

    def measure(self, out: Path, progress: Progress) -> list[Record]:
        """Measure all classes of footprints."""
        from pipeline.shards.manifest import Manifest
        from reports.measure.by_size import measure_errors_by_size

        folder, about = out / self.dataset.folder, self.model.provenance(self.dataset.fingerprint)
        return measure_errors_by_size(self.model.methods(out), Manifest.load(folder), folder, self.seed, about)
