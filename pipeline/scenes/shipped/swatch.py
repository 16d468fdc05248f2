"""A swatch: a square of cloth with one soft fold on a board, under a lamp and a weak second one.

The fold is a wave across the cloth, swept along it, so that the cloth bends and no yarn is stretched: every angle of
light and view between the crest and the valley is seen, and highlights show the floats.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.scenes.scene import Cloth, Scene
from pipeline.scenes.shipped.sheet import camera, developed, sheet, sun

_HEIGHT = 0.05  # half of that of the crest
_POINTS = 801
_BOARD = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.25}}


def _build(mi: Any) -> dict[str, Any]:
    y = np.linspace(-0.5, 0.5, _POINTS)
    curve = np.stack([y, 0.01 + _HEIGHT * (1.0 + np.cos(2.0 * np.pi * y))], axis=-1)
    length, along = developed(curve)
    normal = np.stack([np.zeros_like(y), -along[:, 1], along[:, 0]], axis=-1)[:, None]
    x = np.linspace(-0.5, 0.5, 3)
    points = np.stack(np.broadcast_arrays(x, curve[:, :1], curve[:, 1:]), axis=-1)
    uv = np.stack(np.broadcast_arrays(x, length[:, None]), axis=-1)
    return {
        "type": "scene",
        "cloth": sheet(mi, "swatch", points, np.broadcast_to(normal, points.shape), uv),
        "board": {"type": "rectangle", "to_world": mi.ScalarTransform4f().scale(20), "paint": _BOARD},
        "lamp": sun(mi, [-0.55, 0.75, 0.75], 2.4),
        "fill": sun(mi, [0.6, -0.5, 1.0], 0.5),
        "camera": camera(mi, [0.0, -1.5, 1.6], [0.0, -0.02, 0.03], 34, (256, 192)),
    }


SWATCH = Scene(
    name="swatch",
    source=_build,
    cloths={"swatch": Cloth(fabric="herringbone", yarns=(48.0, 48.0))},
    frames=24,
    step=(0.001, 0.0005, 0.0),
)
"""Herringbone with a fold; the scene of `twillight show`, which puts its fabric there."""
