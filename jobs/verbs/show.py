"""`twillight show`: a fabric's drawdown and yarns on the terminal, and its pictures.

Pictures are a lit swatch, the drawdown (also in colours), height and normals as PNG; maps of the geometry are EXR.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Final

import numpy as np
from cyclopts import Parameter

from jobs.terminal import print_lines, print_table
from jobs.verbs.parameters import FabricName, Local
from pipeline.atomic import atomic_write
from pipeline.scenes.catalogue import load_scene
from reports.images import tiles
from reports.images.exr import write_exr
from weaves.colour_order import ColourOrder
from weaves.fabric import Fabric, load_fabric
from weaves.surface import GAP, surface_maps
from weaves.yarn import Yarn

TEXELS_PER_YARN: Final = 64

SWATCH_SIZE: Final = "384x288"
"""Width and height of the picture of a swatch."""

LEAST_YARNS: Final = 48
"""Yarns across a swatch, at least."""

MOST_YARNS: Final = 400
"""Yarns across a swatch, at most: they are a pixel wide."""

_RUNS = 16  # shown of a sequence of colours
_UNITS: Final = {"width": "yarn spacings", "bend": "degrees", "twist": "degrees"}


def show(
    fabric: FabricName,
    *,
    out: Annotated[
        Local | None, Parameter(help="Folder for pictures, a lit swatch among them, as PNG and EXR.")
    ] = None,
) -> None:
    """Print a fabric, and write its pictures if a folder is given."""
    cloth = load_fabric(fabric)
    _print_fabric(cloth)
    if out is not None:
        print_lines(*write_pictures(cloth, out), write_swatch(fabric, cloth, out))


def write_pictures(fabric: Fabric, folder: Path) -> list[Path]:
    """Write a fabric's pictures into a folder and return their paths.

    The EXR holds one repeat, first pick at the bottom, first end on the left: height in yarn spacings, normal and fibre
    tangent as X (along the weft), Y (along the warp) and Z, the yarn (0 warp, 1 weft, 2 gap), and A = 0 in gaps.
    """
    paths = []
    for draw in (tiles.drawdown, tiles.colours, tiles.height, tiles.normals):
        paths.append(folder / f"{fabric.name}-{draw.__name__}.png")
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


def write_swatch(name: str, fabric: Fabric, folder: Path) -> Path:
    """Write a picture of a lit swatch, the scene ``swatch`` with at least one and a half repeats; return its path."""
    from jobs.verbs.render import dressed, look, make

    period = max(*fabric.weave.repeat, *(len(colours.diffuse) for colours in fabric.thread_colours()))
    yarns = min(max(LEAST_YARNS, 1.5 * period), MOST_YARNS)
    scene = dressed(load_scene("swatch"), [name])
    cloths = {key: cloth.model_copy(update={"yarns": (yarns, yarns)}) for key, cloth in scene.cloths.items()}
    path = folder / f"{fabric.name}-swatch.png"
    how = look(size=SWATCH_SIZE, samples=1, directions=8, tone="srgb", exposure=0.0)
    make(scene.model_copy(update={"cloths": cloths}), "selvage", 1, how, path)
    return path


def _print_fabric(fabric: Fabric) -> None:
    """Print the drawdown of a fabric, and the numbers of its yarns."""
    ends, picks = fabric.weave.repeat
    print_lines(f"{fabric.name}: {fabric.weave.name}, {ends} ends × {picks} picks (██ warp over, last pick first)", "")
    print_lines(fabric.weave.text(), "")
    rows = []
    for name in Yarn.model_fields:
        values = [getattr(yarn, name) for yarn in (fabric.warp, fabric.weft)]
        warp, weft = (f"{value:g}" if isinstance(value, float) else str(value) for value in values)
        rows.append((name, warp, weft, _UNITS.get(name, "")))
    print_table(("yarn", "warp", "weft", "unit"), rows, text=("warp", "weft", "unit"))
    if fabric.colours:
        print_lines(*_colours(fabric.colours))
    print_lines(f"optical thickness {fabric.optical_thickness:g}", fabric.source)


def _colours(order: ColourOrder) -> Iterator[str]:
    """Yield the runs of both sequences; of many, the first."""
    for axis, runs in (("ends", order.ends), ("picks", order.picks)):
        shown = ", ".join(f"{count} {name}" for name, count in runs[:_RUNS])
        more = f", and {len(runs) - _RUNS} more runs" if len(runs) > _RUNS else ""
        threads = len(order.threads(axis))
        yield f"{axis}: {shown}{more}; repeats after {threads}" if runs else f"{axis}: all of one colour"
