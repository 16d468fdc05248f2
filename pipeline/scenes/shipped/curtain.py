"""A back-lit curtain with gaps: the light comes through it, and the window behind is seen between its yarns.

A wave swept downwards unrolls into the plane; uv are its arc length and the height.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.scenes.scene import Cloth, Scene
from pipeline.scenes.shipped.sheet import camera, developed, sheet, sun

_ROWS, _COLUMNS = 2, 1600


def _build(mi: Any) -> dict[str, Any]:
    x = np.linspace(-1.3, 1.3, _COLUMNS + 1)
    curve = np.stack([x, 0.075 * np.sin(14.0 * x + 0.9 * np.sin(3.1 * x))], axis=-1)
    length, along = developed(curve)
    normal = np.stack([along[:, 1], -along[:, 0], np.zeros_like(x)], axis=-1)
    height = np.linspace(-0.9, 0.9, _ROWS + 1)[:, None]
    points = np.stack(np.broadcast_arrays(curve[:, 0], curve[:, 1], height), axis=-1)
    uv = np.stack(np.broadcast_arrays(length, height), axis=-1)
    return {
        "type": "scene",
        "curtain": sheet(mi, "voile", points, np.broadcast_to(normal, points.shape), uv),
        **_window(mi),
        "sun": sun(mi, [0.35, 0.8, 0.45], 3.0),
        "sky": {"type": "constant", "radiance": {"type": "rgb", "value": [0.30, 0.36, 0.45]}},
        "camera": camera(mi, [0, -2.6, 0.0], [0, 0, 0], 34, (256, 192)),
    }


def _window(mi: Any) -> dict[str, Any]:
    """Return the bars of a window behind the curtain."""
    wood = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.25, 0.18, 0.12]}}
    bars = {
        "upright": ([0.0, 0.4, 0.0], [0.05, 0.03, 2.0]),
        "across": ([0.0, 0.4, 0.1], [2.0, 0.03, 0.05]),
    }
    return {
        name: {"type": "cube", "to_world": mi.ScalarTransform4f().translate(place).scale(half), "wood": wood}
        for name, (place, half) in bars.items()
    }


CURTAIN = Scene(
    name="curtain",
    source=_build,
    cloths={"voile": Cloth(yarns=(60.0, 60.0))},
    frames=24,
    step=(0.002, 0.0015, 0.0),
)
"""Voile, the sun behind it, a window's bars that throw shadows on it."""
