"""A roll of cloth seen at its silhouette: the curvature is that of a cylinder, and yarns stand out at the edge."""

from __future__ import annotations

import math
from typing import Any

from pipeline.scenes.scene import Cloth, Scene
from pipeline.scenes.shipped.sheet import camera, sun, wears

_RADIUS, _LENGTH = 0.5, 4.0
_AROUND = 128  # yarns: whole repeats, so that there is no seam


def _build(mi: Any) -> dict[str, Any]:
    ends = {"p0": [-0.5 * _LENGTH, 0, 0], "p1": [0.5 * _LENGTH, 0, 0]}
    return {
        "type": "scene",
        "roll": {"type": "cylinder", **ends, "radius": _RADIUS, "cloth": wears("cotton_twill")},
        "core": {"type": "cylinder", **ends, "radius": 0.98 * _RADIUS},
        "sun": sun(mi, [-0.5, -0.45, 0.75], 3.0),
        "sky": {"type": "constant", "radiance": {"type": "rgb", "value": [0.10, 0.12, 0.16]}},
        "camera": camera(mi, [0.25, -2.2, 0.35], [0, 0, 0.3], 25, (256, 192)),
    }


ROLL = Scene(
    name="roll",
    source=_build,
    cloths={"cotton_twill": Cloth(yarns=(_AROUND, _AROUND * _LENGTH / (2.0 * math.pi * _RADIUS)))},
    frames=24,
    step=(0.001, 0.0008, 0.0),
)
"""Cotton twill, some twenty yarn spacings to the radius."""
