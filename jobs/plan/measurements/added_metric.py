"""A metric from outside, of one model on one fabric."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from jobs.plan.measurements.measurement import Measurement
from jobs.plan.measurements.subjects import Dataset, Subjects, Trained
from jobs.plan.task import Coloured, Progress
from pipeline import versions
from reports.added_metric import AddedMetric
from reports.options import ErrorOptions, Role, select

if TYPE_CHECKING:
    from reports.record import Record


class OfAddedMetric(Measurement):
    """A metric from outside, of all methods of a model, on the held-out queries of a fabric."""

    kind: Literal["added metric"] = "added metric"
    metric: AddedMetric
    """The metric."""
    model: Trained
    """The model."""
    fabric: Coloured
    """The fabric."""
    role: Role
    """Role of the fabric."""
    dataset: Dataset
    """Held-out queries of the fabric."""
    errors: ErrorOptions
    """Number of these queries."""

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        """Yield one a metric, fabric, model that answers for it, and seed."""
        for metric in subjects.recipe.metrics:
            for subject in (*subjects.fabrics, *subjects.unseen_population):
                for _, trained in subjects.answering([subject.fabric.name]):
                    yield cls(
                        metric=metric,
                        model=trained,
                        fabric=subject.fabric,
                        role=subject.role,
                        dataset=subject.dataset,
                        errors=select(ErrorOptions, subjects.recipe.bench),
                    )

    @property
    def group(self) -> str:
        """Name of the metric."""
        return self.metric.name

    @property
    def title(self) -> str:
        """Metric, model and fabric."""
        return f"{self.metric.name} of {self.model.title} on {self.fabric.name}"

    @property
    def name(self) -> str:
        """Beginning of the names of its files."""
        return f"{self.metric.name}-{self.model.options.name}-{self.fabric.name}"

    @property
    def needs(self) -> tuple[str, ...]:
        """Test rows and networks."""
        return (*self.dataset.rows, *self.model.needs)

    @property
    def trained(self) -> tuple[Trained, ...]:
        """The model."""
        return (self.model,)

    @property
    def runs_added_code(self) -> bool:
        """True: the metric is from outside."""
        return True

    def versions(self) -> dict[str, int]:
        """Return the versions of the model and of the benchmark; that of the truth is in its inputs."""
        return {"bench": versions.BENCH, "model": self.model.options.version}

    def measure(self, out: Path, progress: Progress) -> list[Record]:
        """Measure one method after the other."""
        from pipeline.shards.manifest import Manifest
        from reports.measure.held_out import measure_added

        folder, about = out / self.dataset.folder, self.model.provenance(self.dataset.fingerprint)
        manifest = Manifest.load(folder)
        return [
            measure_added(one, self.metric, manifest, folder, self.fabric.name, self.role, self.errors, about)
            for one in self.model.methods(out)
        ]
