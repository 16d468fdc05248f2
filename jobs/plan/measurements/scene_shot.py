"""The frames of a scene, with the truth's answers."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Literal, Self

from jobs.plan.dataset import SECONDS_A_POINT, points_a_row
from jobs.plan.measurements.measurement import Measurement, Picture
from jobs.plan.measurements.subjects import Subjects
from jobs.plan.task import Made, Part, Place, Progress
from pipeline import versions
from pipeline.fingerprint import file_sha256
from pipeline.scenes.catalogue import load_scene
from pipeline.scenes.scene import Cloth
from pipeline.scenes.sources import files, worn
from reports.options import SceneBenchOptions, ShotOptions, select
from weaves.fabric import Fabric, load_fabric

QUERIES_A_PIXEL = 5.0  # roughly


class SceneCloth(Part):
    """A cloth of a scene and how it is laid out."""

    fabric: Fabric
    """The fabric."""
    yarns: tuple[float, float]
    """Yarn spacings in one unit of u and of v."""
    turn: float
    """Angle from u to the weft, in degrees."""


class SceneShot(Measurement):
    """The frames of a scene, with the truth's answers. Every recipe and every model shares them."""

    kind: Literal["scene shot"] = "scene shot"
    scene: str
    """Name of the scene."""
    found: Place
    """Reference to the scene in the recipe: its name, or a path."""
    files: tuple[str, ...]
    """Hashes of its files; none for a scene of the package, which has a version."""
    cloths: dict[str, SceneCloth]
    """Cloths by their names in the scene."""
    step: tuple[float, float, float]
    """Step of the camera from frame to frame."""
    options: ShotOptions
    """Options of the frames and of the truth."""

    @classmethod
    def of(cls, name: str, options: ShotOptions) -> Self:
        """Return the shot of a scene."""
        scene = load_scene(name)
        cloths = {}
        for key, fabric in worn(scene).items():
            cloth = scene.cloths.get(key, Cloth())
            cloths[key] = SceneCloth(fabric=load_fabric(fabric), yarns=cloth.yarns, turn=cloth.turn)
        return cls(
            scene=scene.name,
            found=name,
            files=tuple(file_sha256(path) for path in files(scene)),
            cloths=cloths,
            step=scene.step,
            options=options,
        )

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        """Yield one a scene."""
        yield from cls.all(subjects.recipe.bench.scenes)

    @classmethod
    def all(cls, options: SceneBenchOptions) -> list[Self]:
        """Return the shots of a recipe's scenes, in its order."""
        return [cls.of(name, select(ShotOptions, options)) for name in options.names]

    @property
    def group(self) -> str:
        """The truth of the scenes."""
        return "truth of the scenes"

    @property
    def title(self) -> str:
        """Scene."""
        return f"truth of the scene {self.scene}"

    @property
    def name(self) -> str:
        """Beginning of the names of its files."""
        return f"scene-{self.scene}"

    @property
    def records(self) -> str:
        """No Records."""
        return ""

    @property
    def pictures(self) -> tuple[Picture, ...]:
        """The truth's frames."""
        return (Picture("", self.scene, "truth", "", f"{self.stem}.exr"),)

    @property
    def products(self) -> tuple[str, ...]:
        """Queries with answers, and the truth's frames."""
        return (f"{self.stem}.npz", f"{self.stem}.exr")

    @property
    def fabrics(self) -> list[str]:
        """Names of its fabrics, sorted."""
        return sorted({cloth.fabric.name for cloth in self.cloths.values()})

    @property
    def made(self) -> Made:
        """The queries with answers, as other measurements read them."""
        return Made(task=self.id, path=self.products[0])

    @property
    def cost(self) -> float:
        """Estimated seconds on one core."""
        options = self.options
        points = points_a_row(options.truth) + (options.frames - 1) * points_a_row(options.frame_truth)
        return self._queries * SECONDS_A_POINT * points

    @property
    def size(self) -> int:
        """Estimated bytes."""
        return int(self._queries * self.options.frames * 40)

    @property
    def _queries(self) -> float:
        """Estimated queries of one frame."""
        return self.options.size[0] * self.options.size[1] * QUERIES_A_PIXEL

    def versions(self) -> dict[str, int]:
        """Return the versions of the truth, the scenes, the fallback, whose answers are stored, and the benchmark."""
        return {
            "truth": versions.TRUTH,
            "fallback": versions.FALLBACK,
            "scenes": versions.SCENES,
            "bench": versions.BENCH,
            "scene bench": versions.SCENE_BENCH,
        }

    def run(self, out: Path, progress: Progress) -> None:
        """Render the queries and answer them."""
        from reports.measure.scene.scene_errors import write_truth
        from reports.measure.scene.shot import read_shot, shoot

        shot, picture = (out / path for path in self.products)
        shoot(self.found, self.options, shot)
        write_truth(read_shot(shot), picture)
