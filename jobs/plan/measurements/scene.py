"""One setting of a model on one scene: errors of its frames, pictures."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from jobs.plan.measurements.measurement import Measurement, Picture
from jobs.plan.measurements.scene_shot import QUERIES_A_PIXEL, SceneShot
from jobs.plan.measurements.subjects import Subjects, Trained
from jobs.plan.task import Made, Progress
from pipeline import versions
from reports.options import SceneErrorOptions, select

if TYPE_CHECKING:
    from reports.record import Record


class OnScene(Measurement):
    """One setting of a model on one scene: a change of one setting repeats no other measurement."""

    kind: Literal["scene"] = "scene"
    scene: str
    """Name of the scene."""
    shot: Made
    """Frames of the scene with the truth's answers."""
    model: Trained
    """The model with one setting."""
    options: SceneErrorOptions
    """Options of the comparison."""
    shown: tuple[str, ...]
    """Settings that pictures are made of."""
    extent: tuple[int, int]
    """Width and height of a frame in pixels."""
    frames: int
    """Number of frames."""

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        """Yield one a scene, model that answers for its cloths, seed and setting; pictures are of the first seed."""
        bench = subjects.recipe.bench
        for shot in SceneShot.all(bench.scenes):
            for model, trained in subjects.answering(shot.fabrics):
                for one in trained.settings:
                    yield cls(
                        scene=shot.scene,
                        shot=shot.made,
                        model=one,
                        options=select(SceneErrorOptions, bench.scenes),
                        shown=one.shown(bench.picture_counts) if model.is_first else (),
                        extent=shot.options.size,
                        frames=shot.options.frames,
                    )

    @property
    def group(self) -> str:
        """Name of the model."""
        return f"{self.model.options.name}, scenes"

    @property
    def title(self) -> str:
        """Model, setting and scene."""
        settings = [f"k = {k}" for k in self.model.options.settings]
        return " ".join([self.model.title, *settings, f"on the scene {self.scene}"])

    @property
    def name(self) -> str:
        """Beginning of the names of its files."""
        return f"{self.model.options.name}-{self.scene}"

    @property
    def pictures(self) -> tuple[Picture, ...]:
        """The frames of every setting shown."""
        name = self.model.options.name
        return tuple(Picture("", self.scene, name, setting, self.picture(setting)) for setting in self.shown)

    def picture(self, setting: str) -> str:
        """Return the path of the frames of a setting."""
        return "-".join(filter(None, (self.stem, setting.replace(" = ", "")))) + ".exr"

    @property
    def trained(self) -> tuple[Trained, ...]:
        """The model."""
        return (self.model,)

    @property
    def needs(self) -> tuple[str, ...]:
        """The frames and the networks."""
        return (self.shot.task, *self.model.needs)

    @property
    def cost(self) -> float:
        """Estimated seconds on one core."""
        queries = self._pixels * QUERIES_A_PIXEL * self.frames
        return 1.0 + queries * self.model.options.seconds[1] * (sum(self.model.options.settings) or 1)

    @property
    def size(self) -> int:
        """Estimated bytes of the pictures."""
        return len(self.shown) * self._pixels * (26 + 6 * self.frames)

    @property
    def _pixels(self) -> int:
        return self.extent[0] * self.extent[1]

    def versions(self) -> dict[str, int]:
        """Return the versions of the model, the fallback and the benchmark; that of the truth is in the frames."""
        return {
            "model": self.model.options.version,
            "fallback": versions.FALLBACK,
            "bench": versions.BENCH,
            "scene bench": versions.SCENE_BENCH,
        }

    def measure(self, out: Path, progress: Progress) -> list[Record]:
        """Measure it."""
        from reports.measure.scene.scene_errors import measure_scene
        from reports.measure.scene.shot import read_shot

        methods = self.model.with_fallback(out, self.options.footprint)
        pictures = {setting: out / self.picture(setting) for setting in self.shown}
        shot = read_shot(out / self.shot.path)
        return measure_scene(methods, shot, self.options, pictures, self.model.provenance())
