"""Measurements in scenes: the truth's frames, errors of a model in them, larger pictures, the time of a frame."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Literal, Self

from jobs.plan.measurements.measurement import Measurement
from jobs.plan.measurements.subjects import Subjects, Trained
from jobs.plan.task import Made, Place, Progress, TaskPart
from jobs.plan.truth_cost import TruthCost
from pipeline.fingerprint import file_sha256
from pipeline.models.options import RoundFootprint
from pipeline.scenes.catalogue import load_scene
from pipeline.scenes.scene import Cloth
from pipeline.scenes.sources import files, worn
from reports.options import RepeatOptions, SceneBenchOptions, SceneErrorOptions, ShotOptions, select
from reports.page.content import PictureFile
from weaves.fabric import Fabric, load_fabric

if TYPE_CHECKING:
    from reports.record import Record

_QUERIES_A_PIXEL = 5.0  # roughly
_FALLBACK = 2.5e-5  # seconds of a query of a kind that a model does not know, times the share of such queries


class SceneCloth(TaskPart):
    """A cloth of a scene and how it is laid out."""

    fabric: Fabric
    yarns: tuple[float, float]  # yarn spacings in one unit of u and of v
    turn: float  # angle from u to the weft, in degrees


class _Shot(Measurement):
    """Frames of a scene: queries with the truth's answers, and pictures. All recipes and models share them."""

    larger: ClassVar = False
    code: ClassVar = ("truth", "fallback", "scenes", "bench", "scene_bench")  # answers of the fallback are stored
    endings: ClassVar = (".npz", ".exr")
    scene: str
    found: Place  # reference to the scene in the recipe: its name, or a path
    files: tuple[str, ...]  # hashes of its files; none for a scene of the package, which has a version
    cloths: dict[str, SceneCloth]  # cloths by their names in the scene
    step: tuple[float, float, float]  # step of the camera from frame to frame
    options: ShotOptions

    @classmethod
    def of(cls, name: str, options: ShotOptions) -> Self:
        scene = load_scene(name)
        cloths = {}
        for key, fabric in worn(scene).items():
            cloth = scene.cloths.get(key, Cloth())
            cloths[key] = SceneCloth(fabric=load_fabric(fabric), yarns=cloth.yarns, turn=cloth.turn)
        hashes = tuple(map(file_sha256, files(scene)))
        return cls(scene=scene.name, found=name, files=hashes, cloths=cloths, step=scene.step, options=options)

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        yield from cls.all(subjects.recipe.bench.scenes)

    @classmethod
    def all(cls, options: SceneBenchOptions) -> list[Self]:
        """Return the shots of a recipe's scenes, in its order."""
        raise NotImplementedError

    @property
    def pictures(self) -> tuple[PictureFile, ...]:
        return (PictureFile("", self.scene, "truth", "", Path(self.products[1]), self.larger),)

    @property
    def fabrics(self) -> list[str]:
        return sorted({cloth.fabric.name for cloth in self.cloths.values()})

    @property
    def cost(self) -> float:
        options = self.options
        fabrics = [cloth.fabric for cloth in self.cloths.values()]
        first, further = ([TruthCost(t, f) for f in fabrics] for t in (options.truth, options.frame_truth))
        row, next_row = (sum(answer.row(flat=False) for answer in each) / len(each) for each in (first, further))
        answers = math.prod(options.size) * _QUERIES_A_PIXEL * (row + (options.frames - 1) * next_row)
        return 5.0 + sum(answer.bounces for answer in first) + answers

    def run(self, out: Path, progress: Progress) -> None:
        from reports.measure.scene import scene_errors, shot

        queries, picture = (out / path for path in self.products)
        shot.shoot(self.found, self.options, queries, progress)
        scene_errors.write_truth(shot.read_shot(queries), picture)


class SceneShot(_Shot):
    """The frames in which methods are measured."""

    kind: Literal["scene truth"] = "scene truth"

    @classmethod
    def all(cls, options: SceneBenchOptions) -> list[Self]:
        """Return the shots of a recipe's scenes, in its order."""
        return [cls.of(name, select(ShotOptions, options)) for name in options.names]


class LargerShot(_Shot):
    """The first frame for the larger pictures of the page."""

    kind: Literal["scene picture truth"] = "scene picture truth"
    larger: ClassVar = True

    @classmethod
    def all(cls, options: SceneBenchOptions) -> list[Self]:
        """Return the shots of a recipe's scenes, in its order; none if it wants no larger pictures."""
        larger = select(ShotOptions, options).model_copy(update={"size": options.picture_size, "frames": 1})
        return [cls.of(name, larger) for name in options.names] if options.picture_size else []


class _OnShot(Measurement):
    """One setting of a model on one scene: a change of one setting repeats no other measurement."""

    shots: ClassVar[type[_Shot]]
    code: ClassVar = ("fallback", "bench", "scene_bench")
    scene: str
    shot: Made  # frames of the scene with the truth's answers
    model: Trained
    options: SceneErrorOptions
    shown: tuple[str, ...]  # settings that pictures are made of
    extent: tuple[int, int]  # width and height of a frame in pixels
    frames: int

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        """Yield one a scene, model that answers for its cloths, seed and setting; pictures are of the first seed."""
        bench = subjects.recipe.bench
        for shot in cls.shots.all(bench.scenes):
            for model, trained in subjects.answering(shot.fabrics):
                for options in trained.options.single():
                    single = trained.model_copy(update={"options": options})
                    shown = single.shown(bench.picture_counts) if model.is_first else ()
                    if shown or not shot.larger:
                        yield cls(
                            scene=shot.scene,
                            shot=shot.made,
                            model=single,
                            options=select(SceneErrorOptions, bench.scenes),
                            shown=shown,
                            extent=shot.options.size,
                            frames=shot.options.frames,
                        )

    @property
    def subjects(self) -> tuple[str, ...]:
        return (*super().subjects, *map(self.model.options.setting_of, self.model.options.settings))

    @property
    def pictures(self) -> tuple[PictureFile, ...]:
        subject, larger = ("", self.scene, self.model.options.name), self.shots.larger
        return tuple(PictureFile(*subject, setting, self.picture(setting), larger) for setting in self.shown)

    @property
    def cost(self) -> float:
        queries = math.prod(self.extent) * _QUERIES_A_PIXEL * self.frames
        unknown = queries if {"behind", "curvature"} - self.model.options.kinds else 0.0
        # Tables know light from behind and curved cloth.
        return 0.5 + self.model.seconds(queries, fabrics=3.0) + _FALLBACK * unknown

    def measure(self, out: Path, progress: Progress) -> list[Record]:
        from reports.measure.scene import scene_errors, shot

        methods = self.model.with_fallback(out, self.options.footprint)
        pictures = {setting: out / self.picture(setting) for setting in self.shown}
        frames = shot.read_shot(out / self.shot.path)
        records = scene_errors.measure_scene(methods, frames, self.options, pictures)
        return [] if self.shots.larger else records  # of a larger picture there are none


class OnScene(_OnShot):
    """Errors of one setting of a model in the frames of a scene."""

    kind: Literal["scene errors"] = "scene errors"
    shots: ClassVar = SceneShot


class LargerPicture(_OnShot):
    """A larger picture of a scene by one setting of a model."""

    kind: Literal["scene picture"] = "scene picture"
    shots: ClassVar = LargerShot


class FrameTime(Measurement):
    """The time of a scene's frame by all methods in turns."""

    kind: Literal["frame time"] = "frame time"
    timed: ClassVar = True
    code: ClassVar = ("fallback", "bench")
    seconds: ClassVar = 10.0
    scene: str
    shot: Made  # frames of the scene with the truth's answers
    models: tuple[Trained, ...]  # the models that answer for its cloths
    footprint: RoundFootprint  # round footprint that replaces an ellipse where a method answers round footprints only
    options: RepeatOptions
    seed: int  # seed of the order of the queries

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

    def measure(self, out: Path, progress: Progress) -> list[Record]:
        """Time all methods."""
        from reports.measure.scene import scene_errors, shot

        methods = [method for model in self.models for method in model.with_fallback(out, self.footprint)]
        return scene_errors.time_scene(methods, shot.read_shot(out / self.shot.path), self.options, self.seed)
