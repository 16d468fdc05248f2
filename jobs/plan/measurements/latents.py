"""A model between fabrics: errors of blended latents, times of edits."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Literal

from jobs.plan.measurements.measurement import Measurement
from jobs.plan.measurements.subjects import Subjects, Trained
from jobs.plan.task import Progress, Uncoloured
from pipeline import versions
from pipeline.shards.queries import QueryOptions
from pipeline.truth.options import TruthOptions
from reports.options import LATENT_PAIRS
from weaves.fabric import load_fabric

if TYPE_CHECKING:
    from reports.record import Record


class Latents(Measurement):
    """Answers between pairs of presets, and the time of edits."""

    alone: ClassVar[bool] = True

    kind: Literal["latents"] = "latents"
    model: Trained
    """The model."""
    presets: tuple[Uncoloured, ...]
    """Presets of the pairs."""
    queries: QueryOptions
    """Distribution of the queries."""
    truth: TruthOptions
    """Options of the truth."""

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        """Yield one a model that blends latents, trained with its first seed."""
        names = sorted({name for first, second, _ in LATENT_PAIRS for name in (first, second)})
        dataset = subjects.recipe.dataset
        for model in subjects.first_models:
            if subjects.recipe.bench.latents and model.recipe.options.blends:
                yield cls(
                    model=model.whole,
                    presets=tuple(load_fabric(name) for name in names),
                    queries=dataset.queries,
                    truth=dataset.truth,
                )

    @property
    def group(self) -> str:
        """Name of the model."""
        return self.model.options.name

    @property
    def title(self) -> str:
        """Model."""
        return f"latents of {self.model.options.name}"

    @property
    def name(self) -> str:
        """Beginning of the names of its files."""
        return f"latents-{self.model.options.name}"

    @property
    def needs(self) -> tuple[str, ...]:
        """The training."""
        return self.model.needs

    @property
    def cost(self) -> float:
        """Estimated seconds on one core."""
        return 10.0

    @property
    def size(self) -> int:
        """Estimated bytes."""
        return 4000

    def versions(self) -> dict[str, int]:
        """Return the versions of the truth, the model and the benchmark."""
        return {"truth": versions.TRUTH, "bench": versions.BENCH, "model": self.model.options.version}

    def measure(self, out: Path, progress: Progress) -> list[Record]:
        """Measure edits, then one pair after the other."""
        from reports.measure.latents import measure_edits, measure_paths, pairs

        (method,) = self.model.methods(out)
        about, chosen = self.model.provenance(), pairs()
        records = measure_edits(method, chosen[0].first, provenance=about)
        for index, pair in enumerate(chosen):
            records += measure_paths(method, [pair], self.queries, self.truth, provenance=about)
            progress((index + 1) / len(chosen))
        return records
