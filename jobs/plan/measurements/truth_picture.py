"""The truth's picture of a fabric in one view."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Literal, Self

from jobs.plan.dataset import SECONDS_A_POINT, points_a_row
from jobs.plan.measurements.measurement import Measurement, Picture
from jobs.plan.measurements.subjects import Subjects
from jobs.plan.task import Coloured, Made, Progress
from pipeline import versions
from pipeline.scenes.options import View, ViewOptions
from pipeline.truth.options import TruthOptions
from reports.options import PictureOptions
from weaves.fabric import Fabric

BYTES_A_PIXEL = 28


class TruthPicture(Measurement):
    """The truth's picture of a fabric in one view. Every recipe and every model shares it."""

    kind: Literal["truth picture"] = "truth picture"
    fabric: Coloured
    """The fabric."""
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
    def group(self) -> str:
        """The truth's pictures."""
        return "truth of the pictures"

    @property
    def title(self) -> str:
        """Fabric and view."""
        return f"truth of {self.fabric.name}, {self.scene}"

    @property
    def name(self) -> str:
        """Beginning of the name of its file."""
        return f"truth-{self.fabric.name}-{self.scene}"

    @property
    def records(self) -> str:
        """No Records."""
        return ""

    @property
    def pictures(self) -> tuple[Picture, ...]:
        """The picture."""
        return (Picture(self.fabric.name, self.scene, "truth", "", f"{self.stem}.exr"),)

    @property
    def products(self) -> tuple[str, ...]:
        """The picture."""
        return (f"{self.stem}.exr",)

    @property
    def made(self) -> Made:
        """The picture, as other measurements read it."""
        return Made(task=self.id, path=self.products[0])

    @property
    def cost(self) -> float:
        """Estimated seconds on one core."""
        width, height = self.extent
        return width * height * SECONDS_A_POINT * points_a_row(self.truth)

    @property
    def size(self) -> int:
        """Estimated bytes."""
        return self.extent[0] * self.extent[1] * BYTES_A_PIXEL

    def versions(self) -> dict[str, int]:
        """Return the versions of the truth and of the benchmark."""
        return {"truth": versions.TRUTH, "bench": versions.BENCH}

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
