"""Measurements of the truth itself: images of one fabric, which others and the page read, and studies."""

from __future__ import annotations

import math
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Final, Literal, Self

from jobs.plan.measurements.measurement import Measurement
from jobs.plan.measurements.subjects import Subjects
from jobs.plan.task import Coloured, Progress
from jobs.plan.truth_cost import SECONDS_A_POINT, TruthCost
from jobs.recipe.recipe import Recipe
from pipeline import versions
from pipeline.scenes.options import View, ViewOptions
from pipeline.truth.options import TruthOptions
from reports.options import EdgeOptions, FrameOptions, PictureOptions, StudyName, select
from reports.page.content import PictureFile
from weaves.fabric import Fabric

if TYPE_CHECKING:
    from reports.record import Record

_START = 0.3  # seconds of any image
_LIVE_SECONDS, _POINTS_A_PIXEL, _LIVE_VIEWS = 37.0, 512, 5
_UNTIMED: Final[tuple[StudyName, ...]] = ("stability", "calibration", "bias", "path_traced", "measured_cloth")
_EVALUATED: Final[dict[StudyName, tuple[str, ...]]] = {  # what studies evaluate
    "footprint_colours": ("soft_nodes",),
    "measured_cloth": ("soft_nodes",),
    "path_traced": ("fallback", "mitsuba", "point_sampled", "soft_nodes"),
    "sampling": ("soft_nodes",),
    "throughput": ("fallback", "selvage", "soft_nodes"),
}
_LONG: Final = {"calibration": 400.0, "bias": 170.0, "sampling": 170.0, "measured_cloth": 510.0, "path_traced": 660.0}


class _OfFabric(Measurement):
    """Images of one measured fabric, as one file; all recipes and models share them."""

    code: ClassVar = ("truth", "bench")
    endings: ClassVar = (".exr",)
    fabric: Coloured

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        for fabric, _ in subjects.fabrics:
            yield from cls.of(fabric, subjects.recipe)

    @classmethod
    def of(cls, fabric: Fabric, recipe: Recipe) -> list[Self]:
        """Return the images of a fabric that a recipe has."""
        raise NotImplementedError


class TruthPicture(_OfFabric):
    """The truth's picture of a fabric in one view."""

    kind: Literal["truth picture"] = "truth picture"
    scene: View
    extent: tuple[int, int]  # width and height in pixels
    view: ViewOptions
    truth: TruthOptions
    seed: int  # seed of the truth's points

    @classmethod
    def of(cls, fabric: Fabric, recipe: Recipe) -> list[Self]:
        """Return a picture for each view."""
        bench = recipe.bench
        same = {"fabric": fabric, "view": bench.view, "truth": bench.truth, "seed": bench.seed}
        return [cls(scene=view, extent=bench.size(view), **same) for view in bench.views]

    @property
    def pictures(self) -> tuple[PictureFile, ...]:
        """The picture."""
        return (PictureFile(self.fabric.name, self.scene, "truth", "", Path(self.products[0])),)

    @property
    def cost(self) -> float:
        """Estimated seconds on one core."""
        answers = TruthCost(self.truth, self.fabric)
        return _START + answers.bounces + answers.table + math.prod(self.extent) * answers.row()

    def run(self, out: Path, progress: Progress) -> None:
        """Render it."""
        from reports.measure.pictures import render_truth

        sizes = {"sphere_size": self.extent, "plane_size": self.extent}
        options = PictureOptions(views=(self.scene,), view=self.view, truth=self.truth, seed=self.seed, **sizes)
        render_truth(self.fabric, self.scene, options, out / self.products[0])


class TruthFrames(_OfFabric):
    """The truth's frames of a fabric on the moving plane, for aliasing."""

    kind: Literal["truth frames"] = "truth frames"
    options: FrameOptions

    @classmethod
    def of(cls, fabric: Fabric, recipe: Recipe) -> list[Self]:
        """Return the frames of the fabric, as a list of one."""
        return [cls(fabric=fabric, options=select(FrameOptions, recipe.bench))]

    @property
    def cost(self) -> float:
        """Estimated seconds on one core."""
        answers = TruthCost(self.options.frame_truth, self.fabric)
        return _START + answers.table + math.prod(self.options.frame_size) * self.options.frames * answers.row()

    def run(self, out: Path, progress: Progress) -> None:
        """Render them."""
        from reports.measure.frames import render_frames

        render_frames(self.fabric, self.options, out / self.products[0])


class TruthEdge(_OfFabric):
    """The truth's edge of a cloth cylinder, for silhouettes."""

    kind: Literal["truth edge"] = "truth edge"
    options: EdgeOptions

    @classmethod
    def of(cls, fabric: Fabric, recipe: Recipe) -> list[Self]:
        """Return the edge of the fabric if queries of the recipe are of curved cloth."""
        return [cls(fabric=fabric, options=recipe.bench.edge)] if recipe.dataset.queries.curvature[1] > 0 else []

    @property
    def cost(self) -> float:
        """Estimated seconds on one core."""
        pixels = max(round(self.options.depth / self.options.pixel), 1) * self.options.rows
        return _START + pixels * TruthCost(self.options.truth, self.fabric).row(flat=False)

    def run(self, out: Path, progress: Progress) -> None:
        """Render it."""
        from reports.measure.silhouette import render_edge

        render_edge(self.fabric, self.options, out / self.products[0])


class LivePage(_OfFabric):
    """The live page of a fabric: cloth that the reader turns, in the browser, beside pictures of the truth."""

    kind: Literal["live page"] = "live page"
    endings: ClassVar = (".html",)
    pixels: int  # along each side of the pictures of the truth and of other methods

    @classmethod
    def of(cls, fabric: Fabric, recipe: Recipe) -> list[Self]:
        """Return the page of the fabric if the recipe lists it."""
        live = recipe.bench.live
        return [cls(fabric=fabric, pixels=live.pixels)] if fabric.name in live.fabrics else []

    @property
    def cost(self) -> float:
        """Estimated seconds on one core."""
        return _LIVE_SECONDS + _LIVE_VIEWS * self.pixels**2 * _POINTS_A_PIXEL * SECONDS_A_POINT

    def versions(self) -> dict[str, int]:
        """Return the versions of the truth, of the models that it shows, and of the page."""
        models = {name: versions.MODELS.get(name, 1) for name in ("soft_nodes", "map_material")}
        return {"truth": versions.TRUTH, "viewer": versions.VIEWER} | models

    def run(self, out: Path, progress: Progress) -> None:
        """Write it."""
        from reports.viewer.view import write_page

        write_page(self.fabric, out / self.products[0], self.pixels)


class Study(Measurement):
    """A module of `reports.truth`: all that its ``measure`` yields becomes Records; no data set is read."""

    kind: Literal["study"] = "study"
    code: ClassVar = ("truth", "bench")
    study: StudyName

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        """Yield those that the recipe names."""
        for name in subjects.recipe.bench.studies:
            yield cls(study=name)

    @property
    def cost(self) -> float:
        """Estimated seconds on one core."""
        return _LONG.get(self.study, 40.0)

    @property
    def slots(self) -> Literal["one", "all"]:
        """All where times are among the results."""
        return "one" if self.study in _UNTIMED else "all"

    def versions(self) -> dict[str, int]:
        """Return the versions of its code and of the models that it evaluates."""
        known = {"fallback": versions.FALLBACK, "mitsuba": versions.MITSUBA, **versions.MODELS}
        return super().versions() | {name: known[name] for name in _EVALUATED.get(self.study, ())}

    def measure(self, out: Path, progress: Progress) -> list[Record]:
        """Measure it.

        BadInput if Mitsuba is not installed; WorkFailed if an expression of `stability` exceeds its limit.
        """
        module = import_module(f"reports.truth.{self.study}")
        records: list[Record] = module.RECORDS.to_records(module.measure())
        return records
