"""A table with four fabrics under a lamp: a cloth, a mat, a runner in waves, and a rolled napkin, at many scales."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pipeline.scenes.scene import Cloth, Scene
from pipeline.scenes.shipped.sheet import camera, developed, sheet, wears

_SPACING = 0.012
_NEAR, _FAR, _RADIUS = (0.05, -0.5, 0.075), (0.62, -0.28, 0.075), 0.07


def _build(mi: Any) -> dict[str, Any]:
    move = mi.ScalarTransform4f
    mat = move().translate([0.38, 0.25, 0.01]).rotate([0, 0, 1], 12).scale([0.36, 0.26, 1])
    lamp = {"type": "rgb", "value": [5.2, 4.8, 4.3]}
    return {
        "type": "scene",
        "top": {"type": "rectangle", "to_world": move().scale([1.3, 1.0, 1]), "cloth": wears("table_cloth")},
        "mat": {"type": "rectangle", "to_world": mat, "cloth": wears("mat")},
        "runner": _runner(mi),
        "napkin": {
            "type": "cylinder",
            "p0": list(_NEAR),
            "p1": list(_FAR),
            "radius": _RADIUS,
            "cloth": wears("napkin"),
        },
        "board": {"type": "rectangle", "to_world": move().translate([0, 0, -0.01]).scale([1.3, 1.0, 1])},
        "core": {"type": "disk", "to_world": _end(mi), "paper": {"type": "twosided", "a": {"type": "diffuse"}}},
        "lamp": {"type": "point", "position": [-0.7, 0.5, 1.5], "intensity": lamp},
        "room": {"type": "constant", "radiance": {"type": "rgb", "value": [0.05, 0.05, 0.06]}},
        "camera": camera(mi, [0.1, -2.0, 1.25], [0.02, -0.05, 0.0], 37, (256, 192)),
    }


def _end(mi: Any) -> Any:
    """Return where the roll's near end is, as a disk's transform."""
    outwards = 2.0 * np.array(_NEAR) - _FAR
    return mi.ScalarTransform4f().look_at(list(_NEAR), outwards.tolist(), [0, 0, 1]).scale(_RADIUS)


def _runner(mi: Any) -> Any:
    """Return a strip with waves across it, swept sideways: it unrolls into the plane."""
    y = np.linspace(-0.85, 0.85, 801)
    curve = np.stack([y, 0.03 + 0.05 * np.square(np.cos(4.0 * y)) * (1.0 + y)], axis=-1)
    length, along = developed(curve)
    normal = np.stack([np.zeros_like(y), -along[:, 1], along[:, 0]], axis=-1)[:, None]
    x = np.linspace(-0.75, -0.25, 3)
    points = np.stack(np.broadcast_arrays(x, curve[:, :1], curve[:, 1:]), axis=-1)
    uv = np.stack(np.broadcast_arrays(x, length[:, None]), axis=-1)
    return sheet(mi, "runner", points, np.broadcast_to(normal, points.shape), uv)


TABLE = Scene(
    name="dinner_table",
    source=_build,
    cloths={
        "table_cloth": Cloth(fabric="polyester_lining", yarns=(2.6 / _SPACING, 2.0 / _SPACING)),
        "mat": Cloth(fabric="basket", yarns=(0.72 / (2 * _SPACING), 0.52 / (2 * _SPACING))),
        "runner": Cloth(fabric="silk_charmeuse", yarns=(1.0 / _SPACING, 1.0 / _SPACING)),
        "napkin": Cloth(fabric="denim", yarns=(36.0, math.dist(_NEAR, _FAR) / _SPACING)),
    },
    frames=24,
    step=(0.0015, 0.001, 0.0),
)
"""Lining, basket, charmeuse and denim; the lamp's shadows fall from one on the other."""
