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


class SceneShot(Measurement):
    """Frames of a scene, or the first one for the larger pictures of the page: queries with the truth's answers.

    All recipes and models share them.
    """

    code: ClassVar = ("truth", "fallback", "scenes", "bench", "scene_bench")  # answers of the fallback are stored
    endings: ClassVar = (".npz", ".exr")
    kind: Literal["scene truth", "scene picture truth"]
    scene: str
    found: Place  # reference to the scene in the recipe: its name, or a path
    files: tuple[str, ...]  # hashes of its files; none for a scene of the package, which has a version
    cloths: dict[str, SceneCloth]  # cloths by their names in the scene
    step: tuple[float, float, float]  # step of the camera from frame to frame
    options: ShotOptions

    @classmethod
    def of(cls, bench: SceneBenchOptions, *, larger: bool = False) -> list[Self]:
        """Return the shots of a recipe's scenes, in its order; no larger ones if it wants no larger pictures."""
        if larger and not bench.picture_size:
            return []
        options, shots = select(ShotOptions, bench), []
        if larger:
            options = options.model_copy(update={"size": bench.picture_size, "frames": 1})
        for name in bench.names:
            scene, cloths = load_scene(name), {}
            for key, fabric in worn(scene).items():
                cloth = scene.cloths.get(key, Cloth())
                cloths[key] = SceneCloth(fabric=load_fabric(fabric), yarns=cloth.yarns, turn=cloth.turn)
            kind = "scene picture truth" if larger else "scene truth"
            hashes = tuple(map(file_sha256, files(scene)))
            own = {"scene": scene.name, "found": name, "files": hashes, "cloths": cloths, "step": scene.step}
            shots.append(cls(kind=kind, options=options, **own))
        return shots

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        """Yield the shots and, after those of each kind, the pictures by all methods."""
        for larger in (False, True):
            shots = cls.of(subjects.recipe.bench.scenes, larger=larger)
            yield from shots
            for shot in shots:
                yield from OnScene.of(shot, subjects)

    @property
    def larger(self) -> bool:
        """True if it is for the larger pictures."""
        return self.kind == "scene picture truth"

    @property
    def pictures(self) -> tuple[PictureFile, ...]:
        """The first frame by the truth."""
        return (PictureFile("", self.scene, "truth", "", Path(self.products[1]), self.larger),)

    @property
    def fabrics(self) -> list[str]:
        """Names of the fabrics of its cloths."""
        return sorted({cloth.fabric.name for cloth in self.cloths.values()})

    @property
    def cost(self) -> float:
        """Estimated seconds on one core."""
        options = self.options
        fabrics = [cloth.fabric for cloth in self.cloths.values()]
        first, further = ([TruthCost(t, f) for f in fabrics] for t in (options.truth, options.frame_truth))
        row, next_row = (sum(answer.row(flat=False) for answer in each) / len(each) for each in (first, further))
        answers = math.prod(options.size) * _QUERIES_A_PIXEL * (row + (options.frames - 1) * next_row)
        return 5.0 + sum(answer.bounces for answer in first) + answers

    def run(self, out: Path, progress: Progress) -> None:
        """Shoot the frames, and write the first as a picture."""
        from reports.measure.scene import scene_errors, shot

        queries, picture = (out / path for path in self.products)
        shot.shoot(self.found, self.options, queries, progress)
        scene_errors.write_truth(shot.read_shot(queries), picture)


class OnScene(Measurement):
    """Errors, or a larger picture, of a scene by one setting of a model: a change of it repeats no other measurement.

    Of a larger picture there are no Records.
    """

    code: ClassVar = ("fallback", "bench", "scene_bench")
    kind: Literal["scene errors", "scene picture"]
    scene: str
    shot: Made  # frames of the scene with the truth's answers
    model: Trained
    options: SceneErrorOptions
    shown: tuple[str, ...]  # settings that pictures are made of
    extent: tuple[int, int]  # width and height of a frame in pixels
    frames: int

    @classmethod
    def of(cls, shot: SceneShot, subjects: Subjects) -> Iterator[Self]:
        """Yield one a model that answers for the cloths, seed and setting; pictures are of the first seed."""
        bench = subjects.recipe.bench
        for model in subjects.answering(shot.fabrics):
            for options in model.options.single():
                single = model.model_copy(update={"options": options})
                shown = single.shown(bench.picture_counts) if model.is_first else ()
                if shown or not shot.larger:
                    yield cls(
                        kind="scene picture" if shot.larger else "scene errors",
                        scene=shot.scene,
                        shot=shot.made,
                        model=single,
                        options=select(SceneErrorOptions, bench.scenes),
                        shown=shown,
                        extent=shot.options.size,
                        frames=shot.options.frames,
                    )

    @property
    def larger(self) -> bool:
        """True if it is a larger picture."""
        return self.kind == "scene picture"

    @property
    def subjects(self) -> tuple[str, ...]:
        """Names of the model, the scene and the setting."""
        return (*super().subjects, *map(self.model.options.setting_of, self.model.options.settings))

    @property
    def pictures(self) -> tuple[PictureFile, ...]:
        """A picture a setting shown."""
        subject = ("", self.scene, self.model.options.name)
        return tuple(PictureFile(*subject, setting, self.picture(setting), self.larger) for setting in self.shown)

    @property
    def cost(self) -> float:
        """Estimated seconds on one core; tables know light from behind and curved cloth."""
        queries = math.prod(self.extent) * _QUERIES_A_PIXEL * self.frames
        unknown = queries if {"behind", "curvature"} - self.model.options.kinds else 0.0
        return 0.5 + self.model.seconds(queries, fabrics=3.0) + _FALLBACK * unknown

    def measure(self, out: Path, progress: Progress) -> list[Record]:
        """Measure the frames, and write the pictures."""
        from reports.measure.scene import scene_errors, shot

        methods = self.model.with_fallback(out, self.options.footprint)
        pictures = {setting: out / self.picture(setting) for setting in self.shown}
        records = scene_errors.measure_scene(methods, shot.read_shot(out / self.shot.path), self.options, pictures)
        return [] if self.larger else records


class FrameTime(Measurement):
    """The time of a scene's frame by all methods in turns."""

    kind: Literal["frame time"] = "frame time"
    timed: ClassVar = True
    code: ClassVar = ("fallback", "bench")
    cost: ClassVar = 10.0
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
        for shot in SceneShot.of(bench.scenes):
            yield cls(
                scene=shot.scene,
                shot=shot.made,
                models=tuple(model for model in subjects.answering(shot.fabrics) if model.is_first),
                footprint=bench.scenes.footprint,
                options=select(RepeatOptions, bench),
                seed=bench.scenes.seed,
            )

    def measure(self, out: Path, progress: Progress) -> list[Record]:
        """Time all methods."""
        from reports.measure.scene import scene_errors, shot

        methods = [method for model in self.models for method in model.with_fallback(out, self.footprint)]
        return scene_errors.time_scene(methods, shot.read_shot(out / self.shot.path), self.options, self.seed)
