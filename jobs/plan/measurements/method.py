"""One model on one fabric: errors, white furnace, aliasing, silhouettes, pictures."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from jobs.plan.measurements.images.truth_edge import TruthEdge
from jobs.plan.measurements.images.truth_frames import TruthFrames
from jobs.plan.measurements.images.truth_picture import TruthPicture
from jobs.plan.measurements.measurement import Measurement, Picture
from jobs.plan.measurements.subjects import Dataset, Subjects, Trained, ways_versions
from jobs.plan.task import Coloured, Made, Progress
from pipeline import versions
from pipeline.scenes.options import View
from reports.options import EdgeOptions, ErrorOptions, FrameOptions, PictureOptions, Role, RunOptions, select

if TYPE_CHECKING:
    from reports.record import Record


class OnFabric(Measurement):
    """All methods of a model, one a setting, on one fabric."""

    kind: Literal["method"] = "method"
    model: Trained
    """The model."""
    ways: RunOptions
    """Ways to run it that are measured too."""
    fabric: Coloured
    """The fabric."""
    role: Role
    """Role of the fabric."""
    dataset: Dataset
    """Held-out queries of the fabric."""
    errors: ErrorOptions
    """Number of these queries."""
    frames: Made
    """The truth's frames."""
    frame_options: FrameOptions
    """Options of the frames."""
    views: dict[View, Made]
    """The truth's pictures."""
    picture_options: PictureOptions
    """Options of the pictures."""
    shown: tuple[str, ...]
    """Settings that pictures are made of."""
    edge: Made | None
    """The truth's edge, where cloth is curved."""
    edge_options: EdgeOptions | None
    """Options of the edge."""

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        """Yield one a fabric, model that answers for it, and seed; pictures are made of the first seed alone."""
        recipe = subjects.recipe
        bench = recipe.bench
        for subject in subjects.fabrics:
            frames, edge = TruthFrames.of(subject.fabric, recipe), TruthEdge.of(subject.fabric, recipe)
            views = {view: picture.made for view, picture in TruthPicture.of(subject.fabric, bench).items()}
            for model in subjects.models:
                if trained := model.on([subject.fabric.name]):
                    yield cls(
                        model=trained,
                        ways=model.ways(bench),
                        fabric=subject.fabric,
                        role=subject.role,
                        dataset=subject.dataset,
                        errors=select(ErrorOptions, bench),
                        frames=frames.made,
                        frame_options=select(FrameOptions, bench),
                        views=views if model.is_first else {},
                        picture_options=select(PictureOptions, bench),
                        shown=trained.shown(bench.picture_counts) if model.is_first else (),
                        edge=edge.made if edge else None,
                        edge_options=bench.edge if edge else None,
                    )

    @property
    def group(self) -> str:
        """Name of the model."""
        return self.model.options.name

    @property
    def title(self) -> str:
        """Model and fabric."""
        return f"{self.model.title} on {self.fabric.name}"

    @property
    def name(self) -> str:
        """Beginning of the names of its files."""
        return f"{self.model.options.name}-{self.fabric.name}"

    @property
    def pictures(self) -> tuple[Picture, ...]:
        """A picture a view and setting shown."""
        return tuple(
            Picture(self.fabric.name, view, self.model.options.name, setting, self._picture(setting, view))
            for setting in self.shown
            for view in self.views
        )

    def _picture(self, setting: str, view: View) -> str:
        return "-".join(filter(None, (self.stem, setting.replace(" = ", ""), view))) + ".exr"

    @property
    def trained(self) -> tuple[Trained, ...]:
        """The model."""
        return (self.model,)

    @property
    def needs(self) -> tuple[str, ...]:
        """Test rows, the truth's pictures, networks."""
        edge = [self.edge.task] if self.edge else []
        pictures = [made.task for made in self.views.values()]
        return (*self.dataset.rows, *pictures, self.frames.task, *edge, *self.model.needs)

    @property
    def cost(self) -> float:
        """Estimated seconds on one core."""
        width, height = self.frame_options.frame_size
        queries = self.frame_options.frames * width * height + self.errors.rows + self._pixels
        return 1.0 + queries * self.model.options.seconds[1] * (sum(self.model.options.settings) or 1)

    @property
    def size(self) -> int:
        """Estimated bytes of the pictures."""
        return len(self.shown) * self._pixels * 10

    @property
    def _pixels(self) -> int:
        return sum(width * height for width, height in map(self.picture_options.size, self.views))

    def versions(self) -> dict[str, int]:
        """Return the versions of model, benchmark, energy bound and fallback; that of the truth is in its inputs."""
        return {"bench": versions.BENCH, "model": self.model.options.version, **ways_versions(self.ways)}

    def measure(self, out: Path, progress: Progress) -> list[Record]:
        """Measure one method after the other."""
        from pipeline.shards.manifest import Manifest
        from reports.measure.frames import measure_aliasing
        from reports.measure.furnace import measure_furnace
        from reports.measure.held_out import measure_errors
        from reports.measure.pictures import render_method
        from reports.measure.silhouette import measure_silhouette

        folder, about = out / self.dataset.folder, self.model.provenance(self.dataset.fingerprint)
        manifest, fabric, role = Manifest.load(folder), self.fabric, self.role
        frames, records = out / self.frames.path, []
        methods = self.model.methods(out)
        methods += self.model.variants(methods, self.ways)
        for index, one in enumerate(methods):
            records += measure_errors(one, manifest, folder, fabric.name, role, self.errors, about)
            records += measure_furnace(one, fabric, role, about)
            records += measure_aliasing(one, fabric, role, self.frame_options, frames, about)
            if self.edge and self.edge_options:
                records += measure_silhouette(one, fabric, role, self.edge_options, out / self.edge.path, about)
            for view, truth in self.views.items() if one.setting in self.shown else ():
                path = out / self._picture(one.setting, view)
                options = self.picture_options
                records += render_method(one, fabric, role, view, options, out / truth.path, path, about)
            progress((index + 1) / len(methods))
        return records
