"""The truth's edge of a cloth cylinder."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Literal, Self

from jobs.plan.measurements.images.truth_image import TruthImage
from jobs.plan.measurements.measurement import Measurement
from jobs.plan.measurements.subjects import Subjects
from jobs.plan.task import Progress
from jobs.recipe.recipe import Recipe
from pipeline.truth.options import TruthOptions
from reports.options import EdgeOptions
from weaves.fabric import Fabric


class TruthEdge(TruthImage):
    """The truth's edge of a cloth cylinder, for silhouettes. Every recipe and every model shares it."""

    kind: Literal["truth edge"] = "truth edge"
    options: EdgeOptions
    """Cylinder, camera, light and truth."""

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        """Yield one a fabric, where the recipe's queries are of curved cloth."""
        for subject in subjects.fabrics:
            if edge := cls.of(subject.fabric, subjects.recipe):
                yield edge

    @classmethod
    def of(cls, fabric: Fabric, recipe: Recipe) -> Self | None:
        """Return the edge of a fabric; None where no query of the recipe is of curved cloth."""
        return cls(fabric=fabric, options=recipe.bench.edge) if recipe.dataset.queries.curvature[1] > 0 else None

    @property
    def shows(self) -> str:
        """The edge."""
        return "edge"

    @property
    def pixels(self) -> int:
        """Number of its pixels."""
        return max(round(self.options.depth / self.options.pixel), 1) * self.options.rows

    @property
    def estimator(self) -> TruthOptions:
        """Options of the truth."""
        return self.options.truth

    def run(self, out: Path, progress: Progress) -> None:
        """Render it."""
        from reports.measure.silhouette import render_edge

        render_edge(self.fabric, self.options, out / self.products[0])
