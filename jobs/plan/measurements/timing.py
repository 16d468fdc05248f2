"""Times of all methods side by side, and their errors by the size of footprints."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Literal

from jobs.plan.measurements.measurement import Measurement
from jobs.plan.measurements.subjects import HeldOutRows, Subjects, Trained
from jobs.plan.task import Progress
from pipeline.truth.options import TruthOptions
from reports.options import RunOptions, TimingOptions, select

if TYPE_CHECKING:
    from reports.record import Record


_SECONDS_A_CALL = 0.15  # of a round of one row: all queries, then each of five classes of sizes


class TimedModel(Trained):
    """A model with all its networks, and the ways to run them that are timed too."""

    ways: RunOptions


class TimeOfMethods(Measurement):
    """Times of all methods side by side, on queries of all sizes and by the size of footprints."""

    kind: Literal["timing of all methods"] = "timing of all methods"
    timed: ClassVar = True
    code: ClassVar = ("truth", "bench")  # the truth is timed too
    models: tuple[TimedModel, ...]
    dataset: HeldOutRows
    options: TimingOptions

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        """Yield the one of the recipe, of models trained with their first seed: times do not depend on the weights."""
        bench, firsts = subjects.recipe.bench, (model for model in subjects.models if model.is_first)
        yield cls(
            models=tuple(TimedModel(ways=model.run_options(bench), **dict(model)) for model in firsts),
            dataset=subjects.held_out(*(fabric for fabric, _ in subjects.fabrics)),
            options=select(TimingOptions, bench),
        )

    @property
    def cost(self) -> float:
        """Estimated seconds; a shard of test rows is about one fabric."""
        rows = sum(len(model.options.settings) or 1 for model in self.models)
        prepared = sum(model.seconds(0.0, len(self.dataset.rows), model.ways) for model in self.models)
        return 5.0 + rows * self.options.timing_repeats * _SECONDS_A_CALL + 0.7 * prepared

    @property
    def threads(self) -> int:
        """Most threads that methods are timed with."""
        from reports.measure.timing import thread_counts

        return max(thread_counts(self.options.threads))

    def measure(self, out: Path, progress: Progress) -> list[Record]:
        """Time all queries, then queries by the size of their footprints."""
        from pipeline.models.runtimes import not_run
        from reports.measure.by_size import measure_by_size
        from reports.measure.held_out import measure_timing
        from reports.record import Record

        truth = TruthOptions.model_validate(self.dataset.manifest(out).about["truth"])
        loaded = [(model, model.methods(out)) for model in self.models]
        methods = [method for _, own in loaded for method in own]
        variants = [run for model, own in loaded for run in model.variants(own, model.ways)]
        rows = list(self.dataset.read(out, rows=self.options.rows))
        records = measure_timing(methods + variants, rows, truth, self.options, lambda share: progress(0.6 * share))
        for model, own in loaded:
            for method in own:  # those runtimes that this machine lacks
                for name, reason in not_run(method, model.ways.runtimes).items():
                    records.append(Record(method=method.name, setting=name, metric="not_run", value=1.0, note=reason))
        rows = list(self.dataset.read(out))
        return records + measure_by_size(methods, rows, self.options, lambda share: progress(0.6 + 0.4 * share))
