"""The truth's edge of a cloth cylinder."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Literal, Self

from jobs.plan.dataset import SECONDS_A_POINT, points_a_row
from jobs.plan.measurements.measurement import Measurement
from jobs.plan.measurements.subjects import Subjects
from jobs.plan.measurements.truth_picture import BYTES_A_PIXEL
from jobs.plan.task import Coloured, Made, Progress
from jobs.recipe.recipe import Recipe
from pipeline import versions
from reports.options import EdgeOptions
from weaves.fabric import Fabric


class TruthEdge(Measurement):
    """The truth's edge of a cloth cylinder, for silhouettes. Every recipe and every model shares it."""

    kind: Literal["truth edge"] = "truth edge"
    fabric: Coloured
    """The fabric."""
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
    def group(self) -> str:
        """The truth's pictures."""
        return "truth of the pictures"

    @property
    def title(self) -> str:
        """Fabric."""
        return f"truth of {self.fabric.name}, edge"

    @property
    def name(self) -> str:
        """Beginning of the name of its file."""
        return f"truth-{self.fabric.name}-edge"

    @property
    def records(self) -> str:
        """No Records."""
        return ""

    @property
    def products(self) -> tuple[str, ...]:
        """The picture of the edge."""
        return (f"{self.stem}.exr",)

    @property
    def made(self) -> Made:
        """The picture, as other measurements read it."""
        return Made(task=self.id, path=self.products[0])

    @property
    def cost(self) -> float:
        """Estimated seconds on one core."""
        return self._pixels * SECONDS_A_POINT * points_a_row(self.options.truth)

    @property
    def size(self) -> int:
        """Estimated bytes."""
        return self._pixels * BYTES_A_PIXEL

    @property
    def _pixels(self) -> int:
        return max(round(self.options.depth / self.options.pixel), 1) * self.options.rows

    def versions(self) -> dict[str, int]:
        """Return the versions of the truth and of the benchmark."""
        return {"truth": versions.TRUTH, "bench": versions.BENCH}

    def run(self, out: Path, progress: Progress) -> None:
        """Render it."""
        from reports.measure.silhouette import render_edge

        render_edge(self.fabric, self.options, out / self.products[0])
