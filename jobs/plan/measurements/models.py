"""Measurements of a model away from the queries of a data set: at its extremes, and between fabrics."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Literal

from jobs.plan.measurements.measurement import Measurement
from jobs.plan.measurements.subjects import Subjects, Trained
from jobs.plan.task import Progress, Uncoloured
from pipeline.models.domain import PHYSICS
from pipeline.shards.queries import QueryOptions
from pipeline.truth.options import TruthOptions
from reports.options import EXTREME_PRECISIONS, EXTREME_TRUTH, LATENT_PAIRS, Role
from weaves.fabric import Fabric, load_fabric

if TYPE_CHECKING:
    from reports.record import Record


class AtExtremes(Measurement):
    """All methods of a model at extreme sizes, angles and places, trained ones in half precision too."""

    kind: Literal["extremes"] = "extremes"
    code: ClassVar = ("truth", "extremes")
    model: Trained
    fabrics: tuple[tuple[Uncoloured, Role], ...]
    """One fabric of each role."""
    truth: TruthOptions
    """The recipe's physics, at a fixed precision."""

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        """Yield one a model and seed, on the first fabric of each role that it answers for."""
        physics = {name: getattr(subjects.recipe.dataset.truth, name) for name in PHYSICS}
        truth = EXTREME_TRUTH.model_copy(update=physics)
        for model in subjects.models:
            known: dict[Role, Fabric] = {}
            for fabric, role in subjects.fabrics:
                if model.on([fabric.name]):
                    known.setdefault(role, fabric)
            if trained := model.on([fabric.name for fabric in known.values()]) if known else None:
                yield cls(model=trained, fabrics=tuple((fabric, role) for role, fabric in known.items()), truth=truth)

    @property
    def cost(self) -> float:
        """Estimated seconds on one core."""
        return 0.6 + self.model.seconds(0.0, len(self.fabrics))

    def measure(self, out: Path, progress: Progress) -> list[Record]:
        """Measure all methods side by side."""
        from pipeline.models.added.guarded import unchecked
        from pipeline.models.runtimes import runs
        from reports.measure.extremes import lustrous, measure_extremes

        fabrics = list(self.fabrics)
        if not self.model.options.of_one_material:
            fabrics.append((lustrous(fabrics[0][0]), "unseen"))
        precisions = EXTREME_PRECISIONS if self.model.networks else ()
        families = [[unchecked(method), *runs(method, precisions)] for method in self.model.methods(out)]
        return measure_extremes(families, fabrics, self.truth)


class Latents(Measurement):
    """Answers of a model between pairs of presets, and the time of edits."""

    kind: Literal["latents"] = "latents"
    timed: ClassVar = True
    code: ClassVar = ("truth", "bench")
    seconds: ClassVar = 10.0
    model: Trained
    presets: tuple[Uncoloured, ...]
    """Presets of the pairs."""
    queries: QueryOptions
    truth: TruthOptions

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        """Yield one a model that blends latents, trained with its first seed."""
        names = sorted({name for first, second, _ in LATENT_PAIRS for name in (first, second)})
        dataset = subjects.recipe.dataset
        for model in subjects.first_models:
            if subjects.recipe.bench.latents and model.recipe.options.blends:
                presets = tuple(map(load_fabric, names))
                yield cls(model=model.whole, presets=presets, queries=dataset.queries, truth=dataset.truth)

    def measure(self, out: Path, progress: Progress) -> list[Record]:
        """Measure edits, then one pair after the other."""
        from reports.measure.latents import measure_edits, measure_paths, pairs

        (method,) = self.model.methods(out)
        chosen = pairs()
        records = measure_edits(method, chosen[0].first)
        for index, pair in enumerate(chosen, start=1):
            records += measure_paths(method, pair, self.queries, self.truth)
            progress(index / len(chosen))
        return records
