"""Times of all methods side by side, and errors by the size of footprints."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Literal, Self

from jobs.plan.measurements.measurement import Measurement
from jobs.plan.measurements.subjects import Dataset, Subjects, Trained, ways_versions
from jobs.plan.task import Part, Progress
from pipeline import versions
from reports.options import RunOptions, TimingOptions, select

if TYPE_CHECKING:
    from pipeline.models.method import Method
    from reports.record import Provenance, Record


class Timed(Part):
    """A model and the ways to run it that are timed too."""

    model: Trained
    """The model with all its networks."""
    ways: RunOptions
    """Ways to run them."""

    def not_run(self, methods: list[Method], provenance: Provenance) -> list[Record]:
        """Return a Record for every runtime that this machine lacks."""
        from pipeline.models.runtimes import not_run
        from reports.record import Record

        return [
            Record(method=one.name, setting=name, metric="not_run", value=1.0, note=reason, provenance=provenance)
            for one in methods
            for name, reason in not_run(one, self.ways.runtimes).items()
        ]


class Timing(Measurement):
    """Times of all methods side by side; nothing else may run meanwhile."""

    alone: ClassVar[bool] = True

    kind: Literal["timing"] = "timing"
    models: tuple[Timed, ...]
    """All models."""
    dataset: Dataset
    """The held-out queries of all fabrics."""
    options: TimingOptions
    """Rows, repeats and threads."""

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        """Yield the one of the recipe, of models trained with their first seed: times do not depend on the weights."""
        bench = subjects.recipe.bench
        yield cls(
            models=tuple(Timed(model=one.whole, ways=one.ways(bench)) for one in subjects.first_models),
            dataset=subjects.dataset([subject.fabric.name for subject in subjects.fabrics]),
            options=select(TimingOptions, bench),
        )

    @property
    def group(self) -> str:
        """Timing."""
        return "timing"

    @property
    def title(self) -> str:
        """All methods."""
        return "timing of all methods"

    @property
    def name(self) -> str:
        """Beginning of the names of its files."""
        return "timing"

    @property
    def trained(self) -> tuple[Trained, ...]:
        """The models."""
        return tuple(one.model for one in self.models)

    def without(self, names: Sequence[str]) -> Self:
        """Return the measurement of the other models."""
        left = tuple(one for one in self.models if one.model.options.name not in names)
        return self.model_copy(update={"models": left})

    @property
    def needs(self) -> tuple[str, ...]:
        """Test rows and trainings."""
        return (*self.dataset.rows, *(need for one in self.models for need in one.model.needs))

    @property
    def cost(self) -> float:
        """Estimated seconds."""
        return 60.0

    @property
    def size(self) -> int:
        """Estimated bytes."""
        return 60_000

    @property
    def threads(self) -> int:
        """Most threads that methods are timed with."""
        from reports.measure.timing import thread_counts

        return max(thread_counts(self.options.threads))

    def versions(self) -> dict[str, int]:
        """Return the versions of the truth, which is timed too, the benchmark, the energy bound and every model."""
        models = {one.model.options.name: one.model.options.version for one in self.models}
        ways = {key: value for one in self.models for key, value in ways_versions(one.ways).items()}
        return {"truth": versions.TRUTH, "bench": versions.BENCH, **ways, **models}

    def measure(self, out: Path, progress: Progress) -> list[Record]:
        """Time all queries, then queries by the size of their footprints."""
        from pipeline.shards.manifest import Manifest
        from reports.measure.by_size import measure_by_size
        from reports.measure.held_out import measure_timing
        from reports.record import Provenance

        folder, about = out / self.dataset.folder, Provenance(dataset=self.dataset.fingerprint)
        manifest = Manifest.load(folder)
        loaded = [(one, one.model.methods(out)) for one in self.models]
        methods = [method for _, found in loaded for method in found]
        variants = [run for one, found in loaded for run in one.model.variants(found, one.ways)]
        records = measure_timing(
            methods + variants, manifest, folder, self.options, about, lambda share: progress(0.6 * share)
        )
        records += [record for one, found in loaded for record in one.not_run(found, about)]
        return records + measure_by_size(
            methods, manifest, folder, self.options, about, lambda share: progress(0.6 + 0.4 * share)
        )
