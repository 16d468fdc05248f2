"""A draped cloth with folds: a general cone, as cloth hangs that is held at one place.

Cloth bends and does not stretch. Every surface of straight lines through one point unrolls into the plane: at the
distance r from the point it is r c(t), with c a closed curve on the unit sphere, and its place in the flat cloth has
the polar coordinates r and arc length of c. The curve here is a circle of latitude with waves: folds that grow towards
the hem, that hide light and view from one another. uv are the flat cloth's own lengths, so no yarn is stretched.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from pipeline.scenes.scene import Cloth, Scene
from pipeline.scenes.shipped.sheet import Floats, camera, developed, sheet, sun

DRAPE_YARNS: Final = 80.0
"""Yarns along a unit of uv."""

_FOLDS = 7
_ROWS, _COLUMNS = 24, 2048


def drape_surface() -> tuple[Floats, Floats, Floats]:
    """Return points (R, C, 3), unit normals (R, C, 3) and uv (R, C, 2) of the cloth; z is up."""
    turn = np.linspace(0.0, 2.0 * np.pi, _COLUMNS + 1)
    # Latitude from straight down; the waves are uneven, as folds are.
    wave = np.cos(_FOLDS * turn + 0.8 * np.sin(2.0 * turn)) * (1.0 + 0.3 * np.sin(3.0 * turn + 1.0))
    polar, azimuth = 0.55 + 0.12 * wave, turn + 0.07 * np.sin(2.0 * _FOLDS * turn)
    curve = np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), -np.cos(polar)], axis=-1)
    angle, along = developed(curve)
    normal = np.cross(along, -curve)
    radius = np.linspace(0.25, 1.6, _ROWS + 1)[::-1, None]
    points = radius[..., None] * curve
    uv = np.stack([radius * np.sin(angle), -radius * np.cos(angle)], axis=-1)
    return points, np.broadcast_to(normal, points.shape), uv


def _build(mi: Any) -> dict[str, Any]:
    return {
        "type": "scene",
        "cloth": sheet(mi, "wool_gabardine", *drape_surface()),
        "sun": sun(mi, [-0.75, -0.6, 0.45], 3.0),
        "sky": {"type": "constant", "radiance": {"type": "rgb", "value": [0.12, 0.13, 0.15]}},
        "camera": camera(mi, [0, -3.6, -0.55], [0, 0, -0.88], 24, (256, 192)),
    }


DRAPE = Scene(
    name="drape",
    source=_build,
    cloths={"wool_gabardine": Cloth(yarns=(DRAPE_YARNS, DRAPE_YARNS))},
    frames=24,
    step=(0.003, 0.001, 0.0),
)
"""Gabardine in folds, a sun from the side that leaves half of every fold in shadow."""
