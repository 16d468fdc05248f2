"""A scene brought into Mitsuba: its shapes, what they wear, its lights and its camera; every fault as one sentence."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float64
from pipeline.scenes.lights import Light, lights_of
from pipeline.scenes.options import SceneOptions
from pipeline.scenes.rays import shape_numbers
from pipeline.scenes.scene import PREFIX, Cloth, Scene
from pipeline.scenes.sources import files, refuse_lost_vertices
from pipeline.scenes.variant import instantiate, mitsuba
from weaves.errors import BadInput, nearest
from weaves.fabric import Fabric, load_fabric, preset_names

MOST_PIXELS: Final = 16_384  # most pixels a side of a film


class FilmWindow(NamedTuple):
    """A rectangle of a film, in pixels."""

    left: int
    top: int
    width: int
    height: int


@dataclass(frozen=True)
class Camera:
    """A pinhole, or parallel rays; it looks along the third column of `to_world`."""

    to_world: Float64  # from the camera's axes, left, up and forward, to the world, (4, 4)
    parallel: bool  # true if its rays are
    settings: dict[str, Any]  # the rest, as Mitsuba reads it
    size: tuple[int, int]  # width and height of its film in pixels

    def at(self, scene: Scene, frame: float) -> Camera:
        """Return the camera of a frame."""
        right, up, forward = (frame * length for length in scene.step)
        moved = self.to_world.copy()
        axes = moved[:3, :3] / np.linalg.norm(moved[:3, :3], axis=0)
        moved[:3, 3] += axes @ [-right, up, forward]
        return replace(self, to_world=moved)

    def to_viewer(self, position: Float64) -> Float64:
        """Return the unit vectors from positions to the viewer, (N, 3)."""
        towards = -self.to_world[:3, 2] + 0.0 * position if self.parallel else self.to_world[:3, 3] - position
        return np.asarray(towards / np.linalg.norm(towards, axis=-1, keepdims=True))

    def widening(self, position: Float64) -> Float64:
        """Return what derivatives by the pixel at positions must be multiplied with, (N,).

        Mitsuba lets the rays of a pixel's neighbours start where its own ray crosses the near plane.
        """
        if self.parallel:
            return np.ones(len(position))
        depth = (position - self.to_world[:3, 3]) @ self.to_world[:3, 2]
        return np.asarray(depth / (depth - self.settings["near_clip"]))

    def sensor(self, mi: Any, size: tuple[int, int], window: FilmWindow | None = None) -> Any:
        """Return Mitsuba's sensor, with one ray through the centre of every pixel of a window, or of the whole film."""
        film = {"type": "hdrfilm", "width": size[0], "height": size[1], "component_format": "float32"}
        if window is not None:
            film |= {"crop_offset_x": window.left, "crop_offset_y": window.top}
            film |= {"crop_width": window.width, "crop_height": window.height}
        sensor = {
            "type": "orthographic" if self.parallel else "perspective",
            **self.settings,
            "to_world": mi.ScalarTransform4f(self.to_world),
            "film": {**film, "rfilter": {"type": "box"}},
            "sampler": {"type": "stratified", "sample_count": 1, "jitter": False},
        }
        return mi.load_dict(sensor)


@dataclass(frozen=True)
class Loaded:
    """A scene in Mitsuba."""

    scene: Scene
    options: SceneOptions
    mi: Any  # the module mitsuba
    world: Any  # its scene
    dressed: Any  # the scene's cloth alone
    behind: Any  # the scene without its cloth
    cloths: dict[str, tuple[Cloth, Fabric]]  # the cloth of each key, and its fabric
    worn: dict[str, list[int]]
    """For every key the numbers of the shapes that wear it (`pipeline.scenes.rays.shape_numbers`)."""
    lights: list[Light]
    camera: Camera  # that of frame 0


def load(scene: Scene, options: SceneOptions | None = None) -> Loaded:
    """Load a scene.

    BadInput if it is no Mitsuba scene, lacks a file, wears no fabric or an unknown one, has cloth without uv
    coordinates or bent cloth without normals, a light or camera of another kind, or no light or camera.
    """
    options = options or SceneOptions()
    mi, where = mitsuba(options.variant), str(scene.source) if isinstance(scene.source, Path) else f"scene {scene.name}"
    world = _world(mi, scene, where)
    shapes = world.shapes()
    worn: dict[str, list[int]] = {}
    dressed: dict[str, list[Any]] = {}
    for number, shape in zip(shape_numbers(mi, shapes), shapes, strict=True):
        key = str(shape.bsdf().id()) if shape.bsdf() is not None else ""
        if key.startswith(PREFIX):
            worn.setdefault(key.removeprefix(PREFIX), []).append(number)
            dressed.setdefault(key, []).append(shape)
            refuse_mesh(mi, shape, where, "a fabric", curved=options.curvature != "none")
    if not worn:
        raise BadInput(where, "", "no fabric", f'a shape needs a bsdf with an id such as "{PREFIX}denim"')
    for key in scene.cloths:
        if key not in worn:
            raise BadInput(where, f"cloths.{key}", key, f"no shape has the bsdf {PREFIX + key!r}; {nearest(key, worn)}")
    described = {key: scene.cloths.get(key, Cloth()) for key in worn}
    cloths = {key: (cloth, _fabric(where, key, cloth)) for key, cloth in described.items()}
    cloth = list(chain.from_iterable(dressed.values()))
    lights = lights_of(mi, world, where, options)
    rest = [*(shape for shape in shapes if shape not in cloth), *world.emitters()]
    parts = (_scene_of(mi, cloth), _scene_of(mi, rest))
    return Loaded(scene, options, mi, world, *parts, cloths, worn, lights, _camera(mi, world, where))


def _fabric(where: str, key: str, cloth: Cloth) -> Fabric:
    if not cloth.fabric and key not in (known := preset_names()):
        allowed = f"a bsdf's id must name a preset or a cloth of the scene; {nearest(key, known)}"
        raise BadInput(where, "bsdf", PREFIX + key, allowed)
    return load_fabric(cloth.fabric or key)


def _scene_of(mi: Any, parts: list[Any]) -> Any:
    """Return the scene of some parts of another."""
    named = {f"part_{index}": part for index, part in enumerate(parts)}
    return mi.load_dict({"type": "scene", **named}, optimize=False)


def _world(mi: Any, scene: Scene, where: str) -> Any:
    """Return the scene as Mitsuba loads it."""
    try:
        if isinstance(scene.source, Path):
            for path in files(scene):
                refuse_lost_vertices(path)
            world = instantiate(mi, scene.source, where)
        else:
            world = mi.load_dict({"type": "scene", **scene.source(mi)}, optimize=False)
    except (RuntimeError, TypeError, OSError) as error:
        said = re.sub(r"\[\w+\.cpp:\d+\] ", "", str(error)).replace(where, Path(where).name)
        raise BadInput(where, "", " ".join(said.split()), "a Mitsuba 3 scene that loads is needed") from error
    if not isinstance(world, mi.Scene):
        raise BadInput(where, "", type(world).__name__, 'a Mitsuba scene must have the type "scene"')
    return world


def refuse_mesh(mi: Any, shape: Any, where: str, worn: str, curved: bool = True) -> None:
    """Refuse a mesh that does not say where the yarns of what it wears are or, if `curved`, how it curves."""
    if not shape.is_mesh():
        return
    name = shape.id() or shape.class_name()
    if not _has_uv(mi, shape):
        raise BadInput(where, "shape", name, f"a shape that wears {worn} needs uv coordinates")
    if curved and _faceted(mi, shape):
        allowed = f"a bent mesh that wears {worn} needs vertex normals, which tell its curvature"
        raise BadInput(where, "shape", name, allowed)


def _has_uv(mi: Any, mesh: Any) -> bool:
    """Return whether a mesh has uv coordinates that vary in both directions."""
    if not mesh.has_vertex_texcoords():
        return False
    found = mi.traverse(mesh)
    if "vertex_texcoords" not in found:  # Mitsuba's rectangle and cube, whose uv are known
        return True
    return bool((np.ptp(np.asarray(found["vertex_texcoords"]).reshape(-1, 2), axis=0) > 0.0).all())


def _faceted(mi: Any, mesh: Any) -> bool:
    """Return whether a mesh has facets in several planes, and no normals of its vertices, which tell its curvature."""
    if mesh.has_vertex_normals():
        return False
    place = np.asarray(mi.traverse(mesh)["vertex_positions"], np.float64).reshape(-1, 3)
    sizes = np.linalg.svd(place - place.mean(axis=0), compute_uv=False)
    return bool(sizes[-1] > 1e-5 * sizes[0])


def _camera(mi: Any, world: Any, where: str) -> Camera:
    if not world.sensors():
        raise BadInput(where, "sensor", "none", "a scene needs a camera: perspective or orthographic")
    sensor = world.sensors()[0]
    kind = sensor.class_name()
    if kind not in ("PerspectiveCamera", "OrthographicCamera"):
        raise BadInput(where, "sensor", kind, "the camera must be perspective or orthographic")
    found, parallel = mi.traverse(sensor), kind == "OrthographicCamera"
    settings: dict[str, Any] = {name: _number(found[name]) for name in ("near_clip", "far_clip")}
    if not parallel:
        settings |= {"fov": _number(found["x_fov"]), "fov_axis": "x"}
        offsets = ("principal_point_offset_x", "principal_point_offset_y")
        settings |= {name: _number(found[name]) for name in offsets}
    to_world = np.asarray(found["to_world"].matrix, np.float64).reshape(4, 4, -1)[..., 0]
    width, height = (int(length) for length in sensor.film().size())
    if max(width, height) > MOST_PIXELS:
        raise BadInput(where, "film", f"{width}x{height}", f"at most {MOST_PIXELS:,} pixels a side are allowed")
    return Camera(to_world, parallel, settings, (width, height))


def _number(value: Any) -> float:
    return float(np.asarray(value).reshape(-1)[0])
