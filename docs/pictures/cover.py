"""Render the picture of README.md, reports/cover.png: three draped cloths against the light, path-traced in Mitsuba.

    make list && .venv/bin/python docs/pictures/cover.py      # needs LLVM, takes about ten minutes

Sun and sky stand behind the cloths: voile lets their light through its gaps, charmeuse through its thin yarns, and the
tartan is opaque. The floor is herringbone up to the horizon.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np

import twillight_mitsuba  # noqa: F401, it enters the material and the integrator
from pipeline.scenes.shipped.drape import DRAPE_YARNS, drape_surface
from pipeline.scenes.shipped.sheet import sheet

CLOTHS = {"tartan": -1.9, "voile": 0.0, "silk_charmeuse": 1.9}
"""Fabric of each cloth, and where it hangs."""

T = mi.ScalarTransform4f


def scene(width: int, height: int) -> Any:
    """Return the scene with a camera of width x height pixels."""
    return mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "twillight_path", "max_depth": 6},
            "sky": {"type": "sunsky", "sun_direction": [0.25, 1.0, 0.35], "turbidity": 4.0},
            **{fabric: drape(fabric, place) for fabric, place in CLOTHS.items()},
            "floor": {
                "type": "rectangle",
                "to_world": T().translate([0, 0, -1.62]).scale(60),
                "cloth": {"type": "twillight", "fabric": "herringbone", "yarns": 6000.0, "turn": 30.0},
            },
            "camera": {
                "type": "perspective",
                "fov": 46,
                "to_world": T().look_at([0.4, -5.6, -0.5], [0, 0, -0.85], [0, 0, 1]),
                "film": {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "gaussian"}},
            },
        }
    )


def drape(fabric: str, place: float) -> Any:
    """Return a cloth that hangs from one point at x = place."""
    points, normals, uv = drape_surface()
    mesh = sheet(mi, fabric, points + np.array([place, 0.0, 0.0]), normals, uv)
    mesh.set_bsdf(mi.load_dict({"type": "twillight", "fabric": fabric, "yarns": DRAPE_YARNS}))
    return mesh


if __name__ == "__main__":
    path = Path(__file__).parents[2] / "reports" / "cover.png"
    mi.util.write_bitmap(str(path), mi.render(scene(960, 420), spp=48), write_async=False)
