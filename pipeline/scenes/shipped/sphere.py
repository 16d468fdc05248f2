"""A sphere: every angle of view and light in one picture.

The fabric's plane is wrapped around it by the inverse stereographic projection from the far pole, which is conformal:
yarns cross at right angles everywhere, and their spacing shrinks to half from the centre to the far side's edge.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.scenes.scene import Cloth, Scene
from pipeline.scenes.shipped.sheet import camera, sheet, sun

_CELLS = 320
_REACH = 2.4  # stereographic; the equator lies at 2


def _build(mi: Any) -> dict[str, Any]:
    line = np.linspace(-_REACH, _REACH, _CELLS + 1)
    u, v = np.meshgrid(line, line)
    square = u * u + v * v
    # The near pole looks to -y, where the camera is; z is up.
    points = np.stack([4.0 * u, square - 4.0, 4.0 * v], axis=-1) / (4.0 + square)[..., None]
    return {
        "type": "scene",
        "ball": sheet(mi, "silk_charmeuse", points, points, np.stack([u, v], axis=-1)),
        "core": {"type": "sphere", "radius": 0.98},
        "sun": sun(mi, [-0.45, -0.7, 0.55], 2.6),
        "sky": {"type": "constant", "radiance": {"type": "rgb", "value": [0.08, 0.09, 0.11]}},
        "camera": camera(mi, [0, -4, 0], [0, 0, 0], 38, (256, 192)),
    }


SPHERE = Scene(
    name="sphere",
    source=_build,
    cloths={"silk_charmeuse": Cloth(yarns=(24.0, 24.0), turn=24.0)},
    frames=24,
    step=(0.003, 0.002, 0.0),
)
"""Charmeuse, the sun over the left shoulder, and an even sky."""
