"""The pictures that `twillight show --out` writes: drawdown, height and normals as PNG, the geometry's maps as EXR."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from pipeline.atomic import atomic_write
from reports.images import tiles
from reports.images.exr import write_exr
from weaves.fabric import Fabric
from weaves.surface import GAP, surface_maps

TEXELS_PER_YARN: Final = 64


def write_pictures(fabric: Fabric, folder: Path) -> list[Path]:
    """Write a fabric's pictures into a folder and return their paths.

    The EXR holds one repeat, first pick at the bottom, first end on the left: height in yarn spacings, normal and fibre
    tangent as X (along the weft), Y (along the warp) and Z, the yarn (0 warp, 1 weft, 2 gap), and A = 0 in gaps.
    """
    paths = []
    for kind, draw in (("drawdown", tiles.drawdown), ("height", tiles.height), ("normals", tiles.normals)):
        paths.append(folder / f"{fabric.name}-{kind}.png")
        atomic_write(paths[-1], draw(fabric))
    surface = surface_maps(fabric, TEXELS_PER_YARN)
    solid = surface.yarn != GAP
    channels = {"A": solid, "height": np.where(solid, surface.height, 0.0), "yarn": surface.yarn}
    for axis, name in enumerate("XYZ"):
        channels[f"normal.{name}"] = surface.normal[..., axis]
        channels[f"tangent.{name}"] = surface.tangent[..., axis]
    paths.append(folder / f"{fabric.name}-maps.exr")
    about: dict[str, str | int | float] = {"fabric": fabric.name, "texels_per_yarn": TEXELS_PER_YARN}
    write_exr(paths[-1], {name: plane[::-1] for name, plane in channels.items()}, about)
    return paths
