"""The truth's frames of a fabric on the moving plane."""

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
from reports.options import FrameOptions, select
from weaves.fabric import Fabric


class TruthFrames(Measurement):
    """The truth's frames of a fabric on the moving plane, for aliasing. Every recipe and every model shares them."""

    kind: Literal["truth frames"] = "truth frames"
    fabric: Coloured
    """The fabric."""
    options: FrameOptions
    """Options of the frames and of the truth."""

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        """Yield one a fabric."""
        for subject in subjects.fabrics:
            yield cls.of(subject.fabric, subjects.recipe)

    @classmethod
    def of(cls, fabric: Fabric, recipe: Recipe) -> Self:
        """Return the frames of a fabric."""
        return cls(fabric=fabric, options=select(FrameOptions, recipe.bench))

    @property
    def group(self) -> str:
        """The truth's pictures."""
        return "truth of the pictures"

    @property
    def title(self) -> str:
        """Fabric."""
        return f"truth of {self.fabric.name}, frames"

    @property
    def name(self) -> str:
        """Beginning of the name of its file."""
        return f"truth-{self.fabric.name}-frames"

    @property
    def records(self) -> str:
        """No Records."""
        return ""

    @property
    def products(self) -> tuple[str, ...]:
        """All frames in one file."""
        return (f"{self.stem}.exr",)

    @property
    def made(self) -> Made:
        """The frames, as other measurements read them."""
        return Made(task=self.id, path=self.products[0])

    @property
    def cost(self) -> float:
        """Estimated seconds on one core."""
        return self._pixels * SECONDS_A_POINT * points_a_row(self.options.frame_truth)

    @property
    def size(self) -> int:
        """Estimated bytes."""
        return self._pixels * BYTES_A_PIXEL

    @property
    def _pixels(self) -> int:
        width, height = self.options.frame_size
        return width * height * self.options.frames

    def versions(self) -> dict[str, int]:
        """Return the versions of the truth and of the benchmark."""
        return {"truth": versions.TRUTH, "bench": versions.BENCH}

    def run(self, out: Path, progress: Progress) -> None:
        """Render them."""
        from reports.measure.frames import render_frames

        render_frames(self.fabric, self.options, out / self.products[0])
