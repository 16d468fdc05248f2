"""Render the picture of README.md, reports/cover.jpg: one cloth, whose yarns are thick in front and sub-pixel far away.

    make list && .venv/bin/python docs/pictures/cover.py      # needs LLVM for Mitsuba

Tartan lies in folds up to the horizon, in low sun under an evening sky. The folds grow with the distance, so that near
and far ones are as large in the picture. Nothing is random: the picture has no noise.
"""

import math
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Final

import numpy as np
from PIL import Image

from jobs.verbs.render import shown_at
from pipeline.cores import cores
from pipeline.models import named
from pipeline.models.fallback import Fallback
from pipeline.scenes.loading import load
from pipeline.scenes.options import SceneOptions
from pipeline.scenes.picture import picture
from pipeline.scenes.scene import Cloth, Scene
from pipeline.scenes.shipped import camera, developed, sheet, sun

HERE: Final = Path(__file__).parent
SIZE: Final = (1600, 800)
TURN: Final = math.radians(26.0)  # angle of the folds to the picture
TOWARDS_SUN: Final = (-65.0, 21.0)  # azimuth from the view to the right, and height above the horizon, in degrees
EXPOSURE: Final = 1.9


def folds(mi: Any) -> Any:
    """Return the cloth: a wave swept along a line. Its length, and its height over the mean, grow with the distance."""
    s = np.linspace(math.log(0.05), 5.9, 4000)
    away = 30.0 * np.exp(s) - 30.0
    wave = 0.082 * (away + 40.0) * np.sin(2.0 * np.pi * s / 0.92 + 0.7 * np.sin(1.9 * s) + 0.5)
    height = wave - 0.10 * away + 0.012 * away * s
    height -= np.interp(20.0, away, height) + 19.0
    length, along = developed(np.stack([away, height], axis=-1))
    x = 30.0 * np.sinh(np.linspace(-7.6, 7.6, 160))  # small triangles near the camera
    line, across, up = [math.cos(TURN), math.sin(TURN), 0], [-math.sin(TURN), math.cos(TURN), 0], [0, 0, 1]
    points = np.multiply.outer(x, line) + (np.multiply.outer(away, across) + np.multiply.outer(height, up))[:, None]
    normal = np.multiply.outer(along[:, 0], up) - np.multiply.outer(along[:, 1], across)
    uv = np.stack(np.broadcast_arrays(x, length[:, None]), axis=-1)
    return sheet(mi, "tartan", points, np.broadcast_to(normal[:, None], points.shape), uv)


def sky(mi: Any) -> dict[str, Any]:
    """Return an evening sky, warm at the horizon and blue above; nothing shines from below."""
    height = np.sin(np.linspace(0.5, -0.5, 64) * np.pi)[:, None, None]
    blue, warm = np.array([[0.30, 0.46, 0.85], [1.05, 0.66, 0.38]])
    above = np.exp(-np.maximum(height, 0.0) / 0.22)
    texels = np.broadcast_to(np.where(height < 0.0, 0.0, blue + above * (warm - blue)), (64, 128, 3))
    upright = mi.ScalarTransform4f().rotate([1, 0, 0], 90)
    return {"type": "envmap", "to_world": upright, "bitmap": mi.Bitmap(np.ascontiguousarray(texels, np.float32))}


def parts(mi: Any) -> dict[str, Any]:
    """Return the scene for Mitsuba."""
    azimuth, elevation = map(math.radians, TOWARDS_SUN)
    flat = math.cos(elevation)
    light = sun([flat * math.sin(azimuth), flat * math.cos(azimuth), math.sin(elevation)], 0.0)
    light["irradiance"] = {"type": "rgb", "value": [6.6, 5.2, 3.7]}
    view = camera(mi, [0, 0, 0], [0, 1, -0.125], 45, SIZE)
    return {"type": "scene", "cloth": folds(mi), "sun": light, "sky": sky(mi), "camera": view}


SCENE: Final = Scene(
    name="cover", source=parts, cloths={"tartan": Cloth(fabric=str(HERE / "cover.toml"), yarns=(0.75, 0.75))}
)


class OneColour(Fallback):
    """Soft nodes, whose thread colours are those of a place under any of its lights: that saves most of the time."""

    def colours(self, fabric: Any, queries: Any, seed: int = 0) -> Any:
        """Return the colours of the components of N queries, (N, 4, 3)."""
        _, first, back = np.unique(np.column_stack([queries.u, queries.v, queries.wo]), True, True, axis=0)
        return super().colours(fabric, queries.take(first), seed)[back.ravel()]


def rendered(size: tuple[int, int] = SIZE) -> Any:
    """Return the picture in linear RGB."""
    loaded = load(SCENE, SceneOptions(environment_directions=9, environment_samples=256, largest_sigma=4.0))
    method = OneColour(*named.loaded("soft_nodes:2", "cover", "method"))
    rgb = np.empty((*size[::-1], 3), np.float32)
    with ThreadPoolExecutor(cores()) as pool:
        for part in picture(loaded, method, pool, size):
            rgb[shown_at(part)] = part.planes["rgb"]
    return rgb


def displayed(rgb: Any) -> Image.Image:
    """Return the picture with a soft shoulder, in sRGB."""
    x = (EXPOSURE * np.maximum(rgb, 0.0)) ** 1.15
    x = x * (1.0 + x / 9.0) / (1.0 + 0.5 * x)
    return Image.fromarray((255.0 * np.clip(x, 0.0, 1.0) ** (1 / 2.2)).astype(np.uint8))


if __name__ == "__main__":
    displayed(rendered()).save(HERE.parents[1] / "reports" / "cover.jpg", quality=92, optimize=True)
