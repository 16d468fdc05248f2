"""The truth's frames of a fabric on the moving plane."""

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
from reports.options import FrameOptions, select
from weaves.fabric import Fabric


class TruthFrames(TruthImage):
    """The truth's frames of a fabric on the moving plane, for aliasing. Every recipe and every model shares them."""

    kind: Literal["truth frames"] = "truth frames"
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
    def shows(self) -> str:
        """All frames."""
        return "frames"

    @property
    def pixels(self) -> int:
        """Number of its pixels."""
        width, height = self.options.frame_size
        return width * height * self.options.frames

    @property
    def estimator(self) -> TruthOptions:
        """Options of the truth."""
        return self.options.frame_truth

    def run(self, out: Path, progress: Progress) -> None:
        """Render them."""
        from reports.measure.frames import render_frames

        render_frames(self.fabric, self.options, out / self.products[0])
