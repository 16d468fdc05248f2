"""The time of a scene's frame by all methods."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Literal, Self

from jobs.plan.measurements.measurement import Measurement
from jobs.plan.measurements.scene_shot import SceneShot
from jobs.plan.measurements.subjects import Subjects, Trained
from jobs.plan.task import Made, Progress
from pipeline import versions
from pipeline.models.options import RoundFootprint
from reports.options import RepeatOptions, select

if TYPE_CHECKING:
    from reports.record import Record


class FrameTime(Measurement):
    """The time of a scene's frame by all methods in turns; nothing else may run meanwhile."""

    alone: ClassVar[bool] = True

    kind: Literal["frame time"] = "frame time"
    scene: str
    """Name of the scene."""
    shot: Made
    """Frames of the scene with the truth's answers."""
    models: tuple[Trained, ...]
    """The models that answer for its cloths."""
    footprint: RoundFootprint
    """Round footprint that replaces an ellipse where a method answers round footprints only."""
    options: RepeatOptions
    """Repeats."""
    seed: int
    """Seed of the order of the queries."""

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        """Yield one a scene, of models trained with their first seed: times do not depend on the weights."""
        bench = subjects.recipe.bench
        for shot in SceneShot.all(bench.scenes):
            yield cls(
                scene=shot.scene,
                shot=shot.made,
                models=tuple(trained for model, trained in subjects.answering(shot.fabrics) if model.is_first),
                footprint=bench.scenes.footprint,
                options=select(RepeatOptions, bench),
                seed=bench.scenes.seed,
            )

    @property
    def group(self) -> str:
        """Timing."""
        return "timing, scenes"

    @property
    def title(self) -> str:
        """Scene."""
        return f"time of a frame of {self.scene}"

    @property
    def name(self) -> str:
        """Beginning of the names of its files."""
        return f"timing-{self.scene}"

    @property
    def of_scene(self) -> str:
        """The scene."""
        return self.scene

    @property
    def trained(self) -> tuple[Trained, ...]:
        """The models."""
        return self.models

    def without(self, names: Sequence[str]) -> Self:
        """Return the measurement of the other models."""
        return self.model_copy(update={"models": tuple(one for one in self.models if one.options.name not in names)})

    @property
    def needs(self) -> tuple[str, ...]:
        """The frames and all networks."""
        return (self.shot.task, *(need for model in self.models for need in model.needs))

    @property
    def cost(self) -> float:
        """Estimated seconds."""
        return 10.0

    @property
    def size(self) -> int:
        """Estimated bytes."""
        return 8000

    def versions(self) -> dict[str, int]:
        """Return the versions of the fallback, the benchmark and every model."""
        models = {model.options.name: model.options.version for model in self.models}
        return {"fallback": versions.FALLBACK, "bench": versions.BENCH, **models}

    def measure(self, out: Path, progress: Progress) -> list[Record]:
        """Time all methods."""
        from reports.measure.scene.scene_errors import time_scene
        from reports.measure.scene.shot import read_shot

        methods = [one for model in self.models for one in model.with_fallback(out, self.footprint)]
        return time_scene(methods, read_shot(out / self.shot.path), self.options, self.seed)
