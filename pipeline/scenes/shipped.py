"""The scenes that come with the package; lengths in metres, the yarns larger than life.

Cloth bends and does not stretch: it is a surface that unrolls into the plane, a wave swept along a line or a general
cone, and uv are the flat cloth's own lengths. The sphere alone is stretched.
"""

import math
from collections.abc import Callable
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from pipeline.compiled.arrays import Float64
from pipeline.scenes import swatch
from pipeline.scenes.scene import Cloth, Scene

DRAPE_YARNS: Final = 80.0  # yarns along a unit of uv of the scene `drape`
_SIZE: Final = (256, 192)
_HEM_YARNS: Final = 100.0  # along a unit of uv of the scene `hem`
_HEM_FOCAL, _HEM_RADIUS = 1200.0, 8.0 / _HEM_YARNS  # in pixels; in the scene's lengths
_HEMS: Final = (  # pixels of a yarn; in the picture, from its centre: left and right, height of the axis, tilt
    (40.0, -300, -110, -190, 5.0),
    (40.0 / 3.0, -95, 25, -60, -8.0),
    (40.0 / 9.0, 40, 120, 30, 11.0),
    (40.0 / 27.0, 135, 190, 80, -7.0),
    (0.5, 205, 250, 110, 9.0),
)
_PLANE_SIDE: Final = 1200.0
_ROLL_RADIUS, _ROLL_LENGTH = 0.5, 4.0
_ROLL_AROUND: Final = 128  # yarns: whole repeats, so that there is no seam
_SPACING: Final = 0.012  # of the dinner table's yarns
_UPHOLSTERY: Final = (
    "polyester_lining", "cotton_twill", "silk_charmeuse", "wool_gabardine", "denim", "silk_shantung", "basket",
    "satin_8",
)  # fmt: skip
_NEAR, _FAR, _NAPKIN_RADIUS = (0.05, -0.5, 0.075), (0.62, -0.28, 0.075), 0.07


def _plane(mi: Any) -> dict[str, Any]:
    """Return denim to the horizon: from resolved yarns to many repeats a pixel, where everything aliases that can."""
    ground = mi.ScalarTransform4f().translate([0, 0.45 * _PLANE_SIDE, 0]).scale(0.5 * _PLANE_SIDE)
    return {
        "ground": {"type": "rectangle", "to_world": ground, "cloth": wears("denim")},
        "below": {"type": "rectangle", "to_world": mi.ScalarTransform4f().translate([0, 0, -1]) @ ground},
        "sun": sun([0.5, 0.55, 0.7], 3.0),
        "sky": _sky(0.10, 0.12, 0.16),
        "camera": camera(mi, [0, 0, 1.6], [0.0, 5.0, 0.35], 50),
    }


def _sphere(mi: Any) -> dict[str, Any]:
    """Return charmeuse at every angle of view and light, the sun over the left shoulder.

    The fabric's plane is wrapped around by the inverse stereographic projection from the far pole, which is conformal:
    yarns cross at right angles everywhere, and their spacing shrinks to half from the centre to the far side's edge.
    """
    line = np.linspace(-2.4, 2.4, 321)  # the equator lies at 2
    u, v = np.meshgrid(line, line)
    square = u * u + v * v
    # The near pole looks to -y, where the camera is; z is up.
    points = _joined(4.0 * u, square - 4.0, 4.0 * v) / (4.0 + square)[..., None]
    return {
        "ball": sheet(mi, "silk_charmeuse", points, points, _joined(u, v)),
        "core": {"type": "sphere", "radius": 0.98},
        "sun": sun([-0.45, -0.7, 0.55], 2.6),
        "sky": _sky(0.08, 0.09, 0.11),
        "camera": camera(mi, [0, -4, 0], [0, 0, 0], 38),
    }


def drape_surface() -> tuple[Float64, Float64, Float64]:
    """Return points (R, C, 3), unit normals (R, C, 3) and uv (R, C, 2) of cloth held at one place; z is up.

    Every surface of straight lines through one point unrolls: at the distance r from the point it is r c(t), with c a
    closed curve on the unit sphere, and its place in the flat cloth has the polar coordinates r and arc length of c.
    The curve is a circle of latitude with waves: folds that grow towards the hem, that hide light and view.
    """
    folds = 7
    turn = np.linspace(0.0, 2.0 * np.pi, 2049)
    # Latitude from straight down; the waves are uneven, as folds are.
    wave = np.cos(folds * turn + 0.8 * np.sin(2.0 * turn)) * (1.0 + 0.3 * np.sin(3.0 * turn + 1.0))
    polar, azimuth = 0.55 + 0.12 * wave, turn + 0.07 * np.sin(2.0 * folds * turn)
    curve = np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), -np.cos(polar)], axis=-1)
    angle, along = developed(curve)
    normal = np.cross(along, -curve)
    radius = np.linspace(0.25, 1.6, 25)[::-1, None]
    points = radius[..., None] * curve
    uv = _joined(radius * np.sin(angle), -radius * np.cos(angle))
    return points, np.broadcast_to(normal, points.shape), uv


def _drape(mi: Any) -> dict[str, Any]:
    """Return gabardine in folds, a sun from the side that leaves half of every fold in shadow."""
    return {
        "cloth": sheet(mi, "wool_gabardine", *drape_surface()),
        "sun": sun([-0.75, -0.6, 0.45], 3.0),
        "sky": _sky(0.12, 0.13, 0.15),
        "camera": camera(mi, [0, -3.6, -0.55], [0, 0, -0.88], 24),
    }


def _roll(mi: Any) -> dict[str, Any]:
    """Return a roll of cotton twill at its silhouette: some twenty yarn spacings to the radius."""
    ends = {"p0": [-0.5 * _ROLL_LENGTH, 0, 0], "p1": [0.5 * _ROLL_LENGTH, 0, 0]}
    return {
        "roll": {"type": "cylinder", **ends, "radius": _ROLL_RADIUS, "cloth": wears("cotton_twill")},
        "core": {"type": "cylinder", **ends, "radius": 0.98 * _ROLL_RADIUS},
        "sun": sun([-0.5, -0.45, 0.75], 3.0),
        "sky": _sky(0.10, 0.12, 0.16),
        "camera": camera(mi, [0.25, -2.2, 0.35], [0, 0, 0.3], 25),
    }


def _curtain(mi: Any) -> dict[str, Any]:
    """Return voile with the sun behind it, and the bars of a window, whose shadows fall on it."""
    x, height = np.linspace(-1.3, 1.3, 1601), np.linspace(-0.9, 0.9, 3)[:, None]
    curve = np.stack([x, 0.075 * np.sin(14.0 * x + 0.9 * np.sin(3.1 * x))], axis=-1)
    length, along = developed(curve)
    normal = _joined(along[:, 1], -along[:, 0], 0.0)
    wood = {"type": "diffuse", "reflectance": _rgb(0.25, 0.18, 0.12)}
    bars = {"upright": ([0.0, 0.4, 0.0], [0.05, 0.03, 2.0]), "across": ([0.0, 0.4, 0.1], [2.0, 0.03, 0.05])}
    window = {
        name: {"type": "cube", "to_world": mi.ScalarTransform4f().translate(place).scale(half), "wood": wood}
        for name, (place, half) in bars.items()
    }
    return {
        "curtain": sheet(mi, "voile", _joined(curve[:, 0], curve[:, 1], height), normal, _joined(length, height)),
        **window,
        "sun": sun([0.35, 0.8, 0.45], 3.0),
        "sky": _sky(0.30, 0.36, 0.45),
        "camera": camera(mi, [0, -2.6, 0.0], [0, 0, 0], 34),
    }


def _dinner_table(mi: Any) -> dict[str, Any]:
    """Return a table under a lamp: a cloth, a mat, a runner in waves, and a rolled napkin, at many scales."""
    move = mi.ScalarTransform4f
    mat = move().translate([0.38, 0.25, 0.01]).rotate([0, 0, 1], 12).scale([0.36, 0.26, 1])
    y = np.linspace(-0.85, 0.85, 801)
    wave = 0.03 + 0.05 * np.square(np.cos(4.0 * y)) * (1.0 + y)
    napkin = {"type": "cylinder", "p0": list(_NEAR), "p1": list(_FAR), "radius": _NAPKIN_RADIUS}
    outwards = 2.0 * np.array(_NEAR) - _FAR
    end = move().look_at(list(_NEAR), outwards.tolist(), [0, 0, 1]).scale(_NAPKIN_RADIUS)
    return {
        "top": {"type": "rectangle", "to_world": move().scale([1.3, 1.0, 1]), "cloth": wears("table_cloth")},
        "mat": {"type": "rectangle", "to_world": mat, "cloth": wears("mat")},
        "runner": _waves(mi, "runner", np.linspace(-0.75, -0.25, 3), y, wave),
        "napkin": {**napkin, "cloth": wears("napkin")},
        "board": {"type": "rectangle", "to_world": move().translate([0, 0, -0.01]).scale([1.3, 1.0, 1])},
        "core": {"type": "disk", "to_world": end, "paper": {"type": "twosided", "a": {"type": "diffuse"}}},
        "lamp": {"type": "point", "position": [-0.7, 0.5, 1.5], "intensity": _rgb(5.2, 4.8, 4.3)},
        "room": _sky(0.05, 0.05, 0.06),
        "camera": camera(mi, [0.1, -2.0, 1.25], [0.02, -0.05, 0.0], 37),
    }


def _upholstery(mi: Any) -> dict[str, Any]:
    """Return a sofa of eight strips, each of another cloth: flat, bent outwards and inwards, upright and level."""
    arc = np.linspace(0.0, 0.5 * math.pi, 33)
    # From the floor over the front edge and the seat to the back, and over its top.
    y = np.concatenate([[-0.5], -0.38 - 0.12 * np.cos(arc), 0.28 + 0.12 * np.sin(arc), 0.48 - 0.08 * np.cos(arc)])
    z = np.concatenate([[0.0], 0.28 + 0.12 * np.sin(arc), 0.52 - 0.12 * np.cos(arc), 0.95 + 0.08 * np.sin(arc)])
    length, _ = developed(np.stack([y, z], axis=-1))
    y, z = (np.interp(np.linspace(0.0, length[-1], 801), length, axis) for axis in (y, z))
    left = np.linspace(-1.2, 0.9, len(_UPHOLSTERY))
    strips = {
        name: _waves(mi, name, np.linspace(x + 0.003, x + 0.297, 3), y, z)
        for x, name in zip(left, _UPHOLSTERY, strict=True)
    }
    return {
        **strips,
        "floor": {"type": "rectangle", "to_world": mi.ScalarTransform4f().scale([4.0, 4.0, 1])},
        "sun": sun([-0.6, -0.7, 0.9], 2.6),
        "sky": _sky(0.25, 0.28, 0.32),
        "camera": camera(mi, [-0.6, -3.2, 1.6], [0.03, 0.0, 0.5], 46),
    }


def _swatch(mi: Any) -> dict[str, Any]:
    """Return a square of herringbone with one soft fold on a board, under a lamp and a weak second one.

    Every angle of light and view between the crest and the valley is seen, and highlights show the floats.
    `twillight show` puts its fabric there, without Mitsuba: the numbers are those of `pipeline.scenes.swatch`.
    """
    y = np.linspace(-0.5, 0.5, 801)
    board = {"type": "diffuse", "reflectance": {"type": "rgb", "value": swatch.BOARD}}
    return {
        "cloth": _waves(mi, "swatch", np.linspace(-0.5, 0.5, 3), y, swatch.height(y)),
        "board": {"type": "rectangle", "to_world": mi.ScalarTransform4f().scale(swatch.HALF_BOARD), "paint": board},
        **{f"lamp_{number}": sun(list(towards), power) for number, (towards, power) in enumerate(swatch.LIGHTS)},
        "camera": camera(mi, list(swatch.EYE), list(swatch.LOOKED_AT), swatch.FIELD_OF_VIEW),
    }


def _hem(mi: Any) -> dict[str, Any]:
    """Return strips of denim over tilted lines against the sky: hems of 40, 13, 4.5, 1.5 and .5 pixels a yarn."""
    turn = np.linspace(math.pi, 0.0, 513)
    lines = {}
    for number, (pixels, left, right, height, tilt) in enumerate(_HEMS):
        away = _HEM_FOCAL / (pixels * _HEM_YARNS)
        pixel, hang = away / _HEM_FOCAL, 0.5 * away
        profile = _HEM_RADIUS * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
        profile = np.concatenate([[[-_HEM_RADIUS, -hang]], profile, [[_HEM_RADIUS, -hang]]])
        length, along = developed(profile)
        along[[0, 1, -2, -1]] = [[0, 1], [0, 1], [0, -1], [0, -1]]
        x = np.linspace(left * pixel, right * pixel, 3)
        points = _joined(x, away + profile[:, :1], height * pixel + profile[:, 1:])
        normal = _joined(0.0, -along[:, 1:], along[:, :1])
        sine, cosine = math.sin(math.radians(tilt)), math.cos(math.radians(tilt))
        roll = np.array([[cosine, 0, -sine], [0, 1, 0], [sine, 0, cosine]])
        uv = _joined(x, length[:, None])
        lines[f"strip_{number}"] = sheet(mi, "denim", points @ roll.T, normal @ roll.T, uv)
    return {
        **lines,
        "sun": sun([-0.6, -0.7, 0.55], 3.0),
        "sky": _sky(0.25, 0.32, 0.43),
        "camera": camera(mi, [0, 0, 0], [0, 1, 0], 2.0 * math.degrees(math.atan(0.5 * 512 / _HEM_FOCAL)), (512, 512)),
    }


def _waves(mi: Any, cloth: str, x: Float64, y: Float64, z: Float64) -> Any:
    """Return a strip with the waves z(y), swept along x."""
    length, along = developed(np.stack([y, z], axis=-1))
    points, normal = _joined(x, y[:, None], z[:, None]), _joined(0.0, -along[:, 1:], along[:, :1])
    return sheet(mi, cloth, points, normal, _joined(x, length[:, None]))


def _joined(*coordinates: npt.ArrayLike) -> Float64:
    """Return vectors (..., n) from n coordinates, which are broadcast."""
    return np.stack(np.broadcast_arrays(*coordinates), axis=-1)


def grid_faces(rows: int, columns: int) -> npt.NDArray[np.uint32]:
    """Return the corners of two triangles a cell of a grid, uint32 (N, 3)."""
    corner = np.arange(rows * columns, dtype=np.uint32).reshape(rows, columns)
    a, b, c, d = (part.ravel() for part in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]))
    return np.concatenate([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)])


def sheet(mi: Any, cloth: str, points: Float64, normals: Float64, uv: Float64) -> Any:
    """Return the mesh of a grid of points (R, C, 3), two triangles a cell, that wears the cloth of a key.

    `normals`, which broadcast to the points, are unit normals of the front, `uv` (R, C, 2) lengths along weft and warp.
    """
    rows, columns = points.shape[:2]
    faces = grid_faces(rows, columns)
    settings = mi.Properties()
    settings["bsdf"] = mi.load_dict(wears(cloth))
    has = {"has_vertex_normals": True, "has_vertex_texcoords": True}
    mesh = mi.Mesh(cloth, vertex_count=rows * columns, face_count=len(faces), props=settings, **has)
    parameters = mi.traverse(mesh)
    of_vertices = {"positions": points, "normals": np.broadcast_to(normals, points.shape), "texcoords": uv}
    for name, values in of_vertices.items():
        parameters[f"vertex_{name}"] = values.astype(np.float32).ravel()
    parameters["faces"] = faces.ravel()
    parameters.update()
    return mesh


def developed(curve: Float64) -> tuple[Float64, Float64]:
    """Return arc length from the start along a curve of points (n, d), and unit tangents (n, d).

    The curve must be finely sampled; tangents are central differences.
    """
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=-1))])
    tangent = np.gradient(curve, axis=0)
    return length, tangent / np.linalg.norm(tangent, axis=-1, keepdims=True)


def wears(cloth: str) -> dict[str, Any]:
    """Return the BSDF that dresses a shape."""
    return {"type": "diffuse", "id": f"fabric_{cloth}"}


def camera(
    mi: Any, place: list[float], target: list[float], fov: float, size: tuple[int, int] = _SIZE
) -> dict[str, Any]:
    """Return a pinhole camera with z upwards and a film of some pixels."""
    return {
        "type": "perspective",
        "fov": fov,
        "fov_axis": "x",
        "to_world": mi.ScalarTransform4f().look_at(place, target, [0, 0, 1]),
        "film": {"type": "hdrfilm", "width": size[0], "height": size[1]},
    }


def sun(towards: list[float], irradiance: float) -> dict[str, Any]:
    """Return a directional light from the direction `towards`."""
    return {"type": "directional", "direction": [-x for x in towards], "irradiance": irradiance}


def _sky(*radiance: float) -> dict[str, Any]:
    """Return an environment that is alike everywhere."""
    return {"type": "constant", "radiance": _rgb(*radiance)}


def _rgb(*values: float) -> dict[str, Any]:
    return {"type": "rgb", "value": list(values)}


def _scene(source: Callable[[Any], dict[str, Any]], step: tuple[float, float, float], **cloths: Cloth) -> Scene:
    """Return a scene that is called as the function that makes it."""
    return Scene(name=source.__name__.removeprefix("_"), source=source, cloths=cloths, step=step)


_SCENES: Final = (
    _scene(_plane, (0.003, 0.0, 0.002), denim=Cloth(yarns=(_PLANE_SIDE / 0.12, _PLANE_SIDE / 0.12), turn=24.0)),
    _scene(_sphere, (0.003, 0.002, 0.0), silk_charmeuse=Cloth(yarns=(24.0, 24.0), turn=24.0)),
    _scene(_drape, (0.003, 0.001, 0.0), wool_gabardine=Cloth(yarns=(DRAPE_YARNS, DRAPE_YARNS))),
    _scene(
        _roll,
        (0.001, 0.0008, 0.0),
        cotton_twill=Cloth(yarns=(_ROLL_AROUND, _ROLL_AROUND * _ROLL_LENGTH / (2.0 * math.pi * _ROLL_RADIUS))),
    ),
    _scene(_curtain, (0.002, 0.0015, 0.0), voile=Cloth(yarns=(60.0, 60.0))),
    _scene(
        _dinner_table,
        (0.0015, 0.001, 0.0),
        table_cloth=Cloth(fabric="polyester_lining", yarns=(2.6 / _SPACING, 2.0 / _SPACING)),
        mat=Cloth(fabric="basket", yarns=(0.72 / (2 * _SPACING), 0.52 / (2 * _SPACING))),
        runner=Cloth(fabric="silk_charmeuse", yarns=(1.0 / _SPACING, 1.0 / _SPACING)),
        napkin=Cloth(fabric="denim", yarns=(36.0, math.dist(_NEAR, _FAR) / _SPACING)),
    ),
    _scene(_hem, (0.0001, 0.00005, 0.0), denim=Cloth(yarns=(_HEM_YARNS, _HEM_YARNS), turn=24.0)),
    _scene(_upholstery, (0.001, 0.0005, 0.0), **{name: Cloth(yarns=(80.0, 80.0)) for name in _UPHOLSTERY}),
    _scene(_swatch, (0.001, 0.0005, 0.0), swatch=Cloth(fabric="herringbone", yarns=(48.0, 48.0))),
)

SHIPPED: Final[dict[str, Scene]] = {scene.name: scene for scene in _SCENES}  # every shipped scene by its name
