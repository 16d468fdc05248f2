"""A plane to the horizon: from resolved yarns in front to many repeats a pixel, where everything aliases that can."""

from __future__ import annotations

from typing import Any

from pipeline.scenes.scene import Cloth, Scene
from pipeline.scenes.shipped.sheet import camera, sun, wears

_SIDE = 1200.0
_SPACING = 0.12


def _build(mi: Any) -> dict[str, Any]:
    ground = mi.ScalarTransform4f().translate([0, 0.45 * _SIDE, 0]).scale(0.5 * _SIDE)
    return {
        "type": "scene",
        "ground": {"type": "rectangle", "to_world": ground, "cloth": wears("denim")},
        "below": {"type": "rectangle", "to_world": mi.ScalarTransform4f().translate([0, 0, -1]) @ ground},
        "sun": sun(mi, [0.5, 0.55, 0.7], 3.0),
        "sky": {"type": "constant", "radiance": {"type": "rgb", "value": [0.10, 0.12, 0.16]}},
        "camera": camera(mi, [0, 0, 1.6], [0.0, 5.0, 0.35], 50, (256, 192)),
    }


PLANE = Scene(
    name="plane",
    source=_build,
    cloths={"denim": Cloth(yarns=(_SIDE / _SPACING, _SIDE / _SPACING), turn=24.0)},
    frames=24,
    step=(0.003, 0.0, 0.002),
)
"""Denim, a low sun and an even sky."""
