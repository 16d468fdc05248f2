"""One general model on all random unseen fabrics: errors on held-out queries."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from jobs.plan.measurements.measurement import Measurement
from jobs.plan.measurements.subjects import Dataset, Subjects, Trained, ways_versions
from jobs.plan.task import Coloured, Progress
from pipeline import versions
from reports.options import ErrorOptions, RunOptions, select

if TYPE_CHECKING:
    from reports.record import Record


class OnUnseenPopulation(Measurement):
    """All methods of a model, one a setting, on every random unseen fabric.

    There are no pictures of them: the truth of one picture costs more than all held-out queries of a fabric.
    """

    kind: Literal["unseen population"] = "unseen population"
    model: Trained
    """The model."""
    ways: RunOptions
    """Ways to run it that are measured too."""
    fabrics: tuple[Coloured, ...]
    """The fabrics."""
    dataset: Dataset
    """Held-out queries of the fabrics."""
    errors: ErrorOptions
    """Number of these queries, each fabric."""

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        """Yield one a seed and model that answers for all of the fabrics: models of one material do not."""
        fabrics = tuple(subject.fabric for subject in subjects.unseen_population)
        names, bench = [fabric.name for fabric in fabrics], subjects.recipe.bench
        for model in subjects.models:
            if names and (trained := model.on(names)):
                yield cls(
                    model=trained,
                    ways=model.ways(bench),
                    fabrics=fabrics,
                    dataset=subjects.dataset(names),
                    errors=select(ErrorOptions, bench),
                )

    @property
    def group(self) -> str:
        """Name of the model."""
        return self.model.options.name

    @property
    def title(self) -> str:
        """Model and number of fabrics."""
        return f"{self.model.title} on {len(self.fabrics)} random unseen fabrics"

    @property
    def name(self) -> str:
        """Beginning of the names of its files."""
        return f"{self.model.options.name}-unseen-population"

    @property
    def trained(self) -> tuple[Trained, ...]:
        """The model."""
        return (self.model,)

    @property
    def needs(self) -> tuple[str, ...]:
        """Test rows, network."""
        return (*self.dataset.rows, *self.model.needs)

    @property
    def cost(self) -> float:
        """Estimated seconds on one core."""
        queries = len(self.fabrics) * self.errors.rows
        return 1.0 + queries * self.model.options.seconds[1] * (sum(self.model.options.settings) or 1)

    @property
    def size(self) -> int:
        """Estimated bytes."""
        return 4000 * len(self.fabrics)

    def versions(self) -> dict[str, int]:
        """Return the versions of model, benchmark, energy bound and fallback; that of the truth is in its inputs."""
        return {"bench": versions.BENCH, "model": self.model.options.version, **ways_versions(self.ways)}

    def measure(self, out: Path, progress: Progress) -> list[Record]:
        """Measure one method after the other."""
        from pipeline.shards.manifest import Manifest
        from reports.measure.held_out import measure_errors

        folder, about = out / self.dataset.folder, self.model.provenance(self.dataset.fingerprint)
        manifest, records = Manifest.load(folder), []
        methods = self.model.methods(out)
        methods += self.model.variants(methods, self.ways)
        pairs = [(one, fabric.name) for one in methods for fabric in self.fabrics]
        for index, (one, name) in enumerate(pairs):
            records += measure_errors(one, manifest, folder, name, "unseen", self.errors, about)
            progress((index + 1) / len(pairs))
        return records
