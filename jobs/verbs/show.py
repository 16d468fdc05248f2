"""`twillight show`: a fabric's drawdown and yarns on the terminal, and its pictures.

Pictures are the whole draft and a lit swatch, as PNG. Maps of the geometry are PNG and EXR.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Final

import numpy as np
from cyclopts import Parameter

from jobs.terminal import Terminal, print_lines, print_table
from jobs.verbs.parameters import FabricName, Local
from pipeline.atomic import atomic_write
from pipeline.scenes.catalogue import load_scene
from pipeline.truth.options import TABLE_CELLS
from reports.images import tiles
from reports.images.draft import draft
from reports.images.exr import write_exr
from weaves.colour_order import ColourOrder
from weaves.count import cover
from weaves.errors import BadInput
from weaves.fabric import Fabric, load_fabric
from weaves.surface import GAP, surface_maps
from weaves.yarn import Yarn

TEXELS_PER_YARN: Final = 64
"""Texels of the maps across a yarn, at most."""

MOST_TEXELS: Final = 2048
"""Texels of a side of the maps, at most: they take 36 bytes each."""

SWATCH_SIZE: Final = "384x288"
"""Width and height of the picture of a swatch."""

METHOD_OF_MANY_CELLS: Final = "point_sampled:4"
"""Method of a swatch with more than `TABLE_CELLS` different cells: tables of others grow with them."""

LEAST_YARNS: Final = 48
"""Yarns across a swatch, at least."""

MOST_YARNS: Final = 400
"""Yarns across a swatch, at most: they are a pixel wide."""

_RUNS = 16  # shown of a sequence of colours
_UNITS: Final = {"width": "yarn spacings", "bend": "degrees", "twist": "degrees"}


def show(
    fabric: FabricName,
    *,
    out: Annotated[Local | None, Parameter(help="Folder for pictures: the draft and a lit swatch.")] = None,
    maps: Annotated[bool, Parameter(help="Also height and normals, as PNG and EXR.", negative="")] = False,
    size: Annotated[str, Parameter(help="WIDTHxHEIGHT of the swatch in pixels.")] = SWATCH_SIZE,
) -> None:
    """Print a fabric, and write its pictures if a folder is given."""
    cloth = load_fabric(fabric)
    if out is None and (maps or size != SWATCH_SIZE):
        raise BadInput("show", "", "--out is missing", "a folder is needed for pictures")
    _print_fabric(cloth)
    if out is not None:
        with Terminal().status("draft and maps" if maps else "draft"):
            paths = [*_drawn(cloth, out, draft), *(write_maps(cloth, out) if maps else [])]
        print_lines(*paths, write_swatch(fabric, cloth, out, size))


def _drawn(fabric: Fabric, folder: Path, *draws: Callable[[Fabric], bytes]) -> list[Path]:
    paths = [folder / f"{fabric.name}-{draw.__name__}.png" for draw in draws]
    for path, draw in zip(paths, draws, strict=True):
        atomic_write(path, draw(fabric))
    return paths


def write_maps(fabric: Fabric, folder: Path) -> list[Path]:
    """Write height and normals as pictures, and the geometry as EXR, into a folder and return the paths.

    The EXR holds one repeat, first pick at the bottom, first end on the left: height in yarn spacings, normal and fibre
    tangent as X (along the weft), Y (along the warp) and Z, the yarn (0 warp, 1 weft, 2 gap), and A = 0 in gaps.
    """
    paths = _drawn(fabric, folder, tiles.height, tiles.normals)
    texels = min(TEXELS_PER_YARN, MOST_TEXELS // max(fabric.weave.repeat))
    surface = surface_maps(fabric, texels)
    solid = surface.yarn != GAP
    channels = {"A": solid, "height": np.where(solid, surface.height, 0.0), "yarn": surface.yarn}
    for axis, name in enumerate("XYZ"):
        channels[f"normal.{name}"] = surface.normal[..., axis]
        channels[f"tangent.{name}"] = surface.tangent[..., axis]
    paths.append(folder / f"{fabric.name}-maps.exr")
    about: dict[str, str | int | float] = {"fabric": fabric.name, "texels_per_yarn": texels}
    write_exr(paths[-1], {name: plane[::-1] for name, plane in channels.items()}, about)
    return paths


def write_swatch(name: str, fabric: Fabric, folder: Path, size: str) -> Path:
    """Write a picture of a lit swatch, the scene ``swatch`` with at least one and a half repeats; return its path."""
    from jobs.verbs.render import dressed, look, make

    period = max(*fabric.weave.repeat, *(len(colours.diffuse) for colours in fabric.thread_colours()))
    yarns = min(max(LEAST_YARNS, 1.5 * period), MOST_YARNS)
    scene = dressed(load_scene("swatch"), [name])
    cloths = {key: cloth.model_copy(update={"yarns": (yarns, yarns)}) for key, cloth in scene.cloths.items()}
    path = folder / f"{fabric.name}-swatch.png"
    method = "selvage" if fabric.weave.different_cells() <= TABLE_CELLS else METHOD_OF_MANY_CELLS
    how = look(size=size, samples=1, directions=8, tone="srgb", exposure=0.0)
    make(scene.model_copy(update={"cloths": cloths}), method, 1, how, path)
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
    closed = cover(fabric.warp, fabric.weft)
    shares = f"warp {closed.warp:.1%}, weft {closed.weft:.1%}, cloth {closed.cloth:.1%}; openness {closed.openness:.1%}"
    print_lines(f"cover factor: {shares}")
    if closed.openness:
        angles = f"{closed.cut_off_along_warp:.0f}° along the warp, {closed.cut_off_along_weft:.0f}° along the weft"
        print_lines(f"cut-off angle of light through the gaps: {angles}")
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
