"""Render the picture of README.md, reports/cover.jpg: hanging cloth with light behind it, path-traced in Mitsuba.

    make list && .venv/bin/python docs/pictures/cover.py      # needs LLVM, takes a quarter of an hour

Tartan and charmeuse let little light through; organza lets it through its yarns and through its gaps, so that the cloth
behind it is seen. The floor is herringbone up to the horizon.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import mitsuba as mi
import numpy as np

import twillight_mitsuba  # noqa: F401, it enters the material and the integrator
from pipeline.scenes.shipped import developed, sheet

HANGING: Final = {
    "tartan": ((-1.25, 0.15), 0.62, 150.0),
    "organza": ((0.0, -0.25), 0.72, 130.0),
    "silk_charmeuse": ((1.25, 0.15), 0.62, 110.0),
}
"""Fabric of each cloth; where it hangs, half of its width, and yarns in a unit of length."""

EXPOSURE: Final = 1.0

T = mi.ScalarTransform4f


def scene(width: int, height: int) -> Any:
    """Return the scene with a camera of width x height pixels."""
    return mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "twillight_path", "max_depth": 6},
            # Without the sun itself: what shines through gaps is found by chance alone, and a sun is small.
            "sky": {
                "type": "sunsky",
                "sun_direction": [-0.35, 1.0, 0.3],
                "turbidity": 3.0,
                "sun_scale": 0.0,
                "sky_scale": 2.5,
            },
            "behind": window([-3.0, 6.0, 6.2], 4.0, [10.0, 8.2, 6.0]),
            "front": window([3.5, -6.0, 3.5], 1.6, [2.2, 2.4, 2.6]),
            **{name: hanging(name, *place) for name, place in HANGING.items()},
            "floor": {
                "type": "rectangle",
                "to_world": T().translate([0, 0, -0.8]).scale(3000),
                "cloth": {"type": "twillight", "fabric": "herringbone", "yarns": 200_000.0, "turn": 30.0},
            },
            "camera": {
                "type": "perspective",
                "fov": 38,
                "to_world": T().look_at([0.5, -7.2, 0.7], [0, 0, 0.02], [0, 0, 1]),
                "film": {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "gaussian"}},
            },
        }
    )


def window(place: list[float], half: float, radiance: list[float]) -> dict[str, Any]:
    """Return a square light that faces the cloths."""
    to_world = T().look_at(place, [0, 0, 0], [0, 0, 1]).scale(half)
    light = {"type": "area", "radiance": {"type": "rgb", "value": radiance}}
    return {"type": "rectangle", "to_world": to_world, "light": light}


def hanging(fabric: str, centre: tuple[float, float], half: float, yarns: float) -> Any:
    """Return a cloth that hangs in waves: a curve swept downwards, which unrolls into the plane."""
    x = np.linspace(-half, half, 1200)
    curve = np.stack([x, 0.085 * np.sin(15.0 * x + 1.1 * np.sin(3.7 * x + centre[0]))], axis=-1)
    length, along = developed(curve)
    height = np.array([-0.78, 0.95])[:, None]
    points = np.stack(np.broadcast_arrays(centre[0] + curve[:, 0], centre[1] + curve[:, 1], height), axis=-1)
    normal = np.stack([along[:, 1], -along[:, 0], np.zeros_like(x)], axis=-1)
    uv = np.stack(np.broadcast_arrays(length, height), axis=-1)
    mesh = sheet(mi, fabric, points, np.broadcast_to(normal, points.shape), uv)
    mesh.set_bsdf(mi.load_dict({"type": "twillight", "fabric": fabric, "yarns": yarns}))
    return mesh


if __name__ == "__main__":
    path = Path(__file__).parents[2] / "reports" / "cover.jpg"
    mi.util.write_bitmap(str(path), EXPOSURE * mi.render(scene(840, 360), spp=48), write_async=False, quality=90)
