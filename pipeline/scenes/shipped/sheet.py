"""Sheets of cloth as Mitsuba meshes: a grid of points with uv coordinates and normals of its own."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


def sheet(mi: Any, cloth: str, points: Floats, normals: Floats, uv: Floats) -> Any:
    """Return the mesh of a grid of points, two triangles a cell.

    Parameters
    ----------
    mi : module
        Mitsuba.
    cloth : str
        Key of what it wears.
    points, normals : float (R, C, 3)
        Positions, and unit normals of the front.
    uv : float (R, C, 2)
        Lengths along the cloth: u along its weft, v along its warp.
    """
    rows, columns = points.shape[:2]
    corner = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (part.ravel() for part in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)])
    settings = mi.Properties()
    settings["bsdf"] = mi.load_dict(wears(cloth))
    mesh = mi.Mesh(
        cloth,
        vertex_count=rows * columns,
        face_count=len(faces),
        has_vertex_normals=True,
        has_vertex_texcoords=True,
        props=settings,
    )
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = points.astype(np.float32).ravel()
    parameters["vertex_normals"] = normals.astype(np.float32).ravel()
    parameters["vertex_texcoords"] = uv.astype(np.float32).ravel()
    parameters["faces"] = faces.astype(np.uint32).ravel()
    parameters.update()
    return mesh


def developed(curve: Floats) -> tuple[Floats, Floats]:
    """Return arc length from the start along a curve of points (n, d), and unit tangents (n, d).

    The curve must be finely sampled; tangents are central differences.
    """
    steps = np.linalg.norm(np.diff(curve, axis=0), axis=-1)
    length = np.concatenate([[0.0], np.cumsum(steps)])
    tangent = np.gradient(curve, axis=0)
    return length, tangent / np.linalg.norm(tangent, axis=-1, keepdims=True)


def wears(cloth: str) -> dict[str, Any]:
    """Return the BSDF that dresses a shape."""
    return {"type": "diffuse", "id": f"fabric_{cloth}"}


def camera(mi: Any, place: list[float], target: list[float], fov: float, size: tuple[int, int]) -> dict[str, Any]:
    """Return a pinhole camera with z upwards."""
    return {
        "type": "perspective",
        "fov": fov,
        "fov_axis": "x",
        "to_world": mi.ScalarTransform4f().look_at(place, target, [0, 0, 1]),
        "film": {"type": "hdrfilm", "width": size[0], "height": size[1]},
    }


def sun(mi: Any, towards: list[float], irradiance: float) -> dict[str, Any]:
    """Return a directional light from the direction `towards`."""
    return {"type": "directional", "direction": [-x for x in towards], "irradiance": irradiance}
