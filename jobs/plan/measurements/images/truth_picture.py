"""The truth's picture of a fabric in one view."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Literal, Self

from jobs.plan.measurements.images.truth_image import TruthImage
from jobs.plan.measurements.measurement import Measurement, Picture
from jobs.plan.measurements.subjects import Subjects
from jobs.plan.task import Progress
from pipeline.scenes.options import View, ViewOptions
from pipeline.truth.options import TruthOptions
from reports.options import PictureOptions
from weaves.fabric import Fabric


class TruthPicture(TruthImage):
    """The truth's picture of a fabric in one view. Every recipe and every model shares it."""

    kind: Literal["truth picture"] = "truth picture"
    scene: View
    """The view."""
    extent: tuple[int, int]
    """Width and height in pixels."""
    view: ViewOptions
    """Camera, light and scale."""
    truth: TruthOptions
    """Options of the truth."""
    seed: int
    """Seed of the truth's points."""

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        """Yield one a fabric and view."""
        for subject in subjects.fabrics:
            yield from cls.of(subject.fabric, subjects.recipe.bench).values()

    @classmethod
    def of(cls, fabric: Fabric, bench: PictureOptions) -> dict[View, Self]:
        """Return the pictures of a fabric by view."""
        return {
            scene: cls(
                fabric=fabric,
                scene=scene,
                extent=bench.size(scene),
                view=bench.view,
                truth=bench.truth,
                seed=bench.seed,
            )
            for scene in bench.views
        }

    @property
    def pictures(self) -> tuple[Picture, ...]:
        """The picture."""
        return (Picture(self.fabric.name, self.scene, "truth", "", f"{self.stem}.exr"),)

    @property
    def shows(self) -> str:
        """The view."""
        return self.scene

    @property
    def pixels(self) -> int:
        """Number of its pixels."""
        return self.extent[0] * self.extent[1]

    @property
    def estimator(self) -> TruthOptions:
        """Options of the truth."""
        return self.truth

    def run(self, out: Path, progress: Progress) -> None:
        """Render it."""
        from reports.measure.pictures import render_truth

        options = PictureOptions(
            views=(self.scene,),
            sphere_size=self.extent,
            plane_size=self.extent,
            view=self.view,
            truth=self.truth,
            seed=self.seed,
        )
        render_truth(self.fabric, self.scene, options, out / self.products[0])
