"""`twillight show`: a fabric's drawdown and yarns on the terminal, and its pictures.

Pictures are the whole draft and a lit swatch, as PNG. Maps of the geometry are PNG and EXR.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import numpy as np
from cyclopts import Parameter

from jobs.terminal import Terminal, print_lines, print_table, progress
from jobs.verbs.parameters import FabricName, Local
from pipeline.atomic import atomic_write, refuse_unwritable
from pipeline.cores import cores
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

if TYPE_CHECKING:
    from pipeline.models.fallback import Fallback

_TEXELS_PER_YARN = 64  # of the maps, at most
_MOST_TEXELS = 2048  # of a side of the maps: they take 36 bytes each
_SWATCH_SIZE: Final = "1200x900"
_POINTS = 4  # a pixel of a swatch with more than `TABLE_CELLS` different cells: tables of other methods grow with them
_WALKS = 1 << 14  # of the table of light between yarns: a quarter of the usual ones, for a picture
_QUERIES_OF_PIXEL = 12  # that a pixel of a swatch counts for: it has 3, but smaller windows take less memory
_LEAST_YARNS, _MOST_YARNS = 48, 400  # across a swatch; at most they are a pixel wide

_RUNS = 16  # shown of a sequence of colours
_UNITS: Final = {"width": "yarn spacings", "bend": "degrees", "twist": "degrees"}


def show(
    fabric: FabricName,
    *,
    out: Annotated[Local | None, Parameter(help="Folder for pictures: the draft and a lit swatch.")] = None,
    maps: Annotated[bool, Parameter(help="Also height and normals, as PNG and EXR.", negative="")] = False,
    size: Annotated[str, Parameter(help="WIDTHxHEIGHT of the swatch in pixels.")] = _SWATCH_SIZE,
) -> None:
    """Print a fabric, and write its pictures if a folder is given."""
    cloth = load_fabric(fabric)
    if out is None:
        if maps or size != _SWATCH_SIZE:
            raise BadInput("show", "", "--out is missing", "a folder is needed for pictures")
        _print_fabric(cloth)
        return
    from jobs.verbs.render import size_of  # modules that the numbers alone need not wait for

    film = size_of(size, "show")
    _print_fabric(cloth)
    with Terminal().status("draft and maps" if maps else "draft"):
        paths = _drawn(cloth, out, draft)
        if maps:
            paths += [*_drawn(cloth, out, tiles.height, tiles.normals), out / f"{cloth.name}-maps.exr"]
            write_geometry(cloth, paths[-1], _TEXELS_PER_YARN)
    print_lines(*paths, write_swatch(cloth, out, film))


def _drawn(fabric: Fabric, folder: Path, *draws: Callable[[Fabric], bytes]) -> list[Path]:
    paths = [folder / f"{fabric.name}-{draw.__name__}.png" for draw in draws]
    for path, draw in zip(paths, draws, strict=True):
        atomic_write(path, draw(fabric))
    return paths


def write_geometry(fabric: Fabric, path: Path, texels: int) -> None:
    """Write one repeat as EXR, with so many texels across a yarn if its sides stay within 2048.

    First pick at the bottom, first end on the left: height in yarn spacings, normal and fibre tangent as X (along the
    weft), Y (along the warp) and Z, the yarn (0 warp, 1 weft, 2 gap), and A = 0 in gaps.
    """
    texels = min(texels, _MOST_TEXELS // max(fabric.weave.repeat))
    surface = surface_maps(fabric, texels)
    solid = surface.yarn != GAP
    channels = {"A": solid, "height": np.where(solid, surface.height, 0.0), "yarn": surface.yarn}
    for axis, name in enumerate("XYZ"):
        channels[f"normal.{name}"] = surface.normal[..., axis]
        channels[f"tangent.{name}"] = surface.tangent[..., axis]
    about: dict[str, str | int | float] = {"fabric": fabric.name, "texels_per_yarn": texels}
    write_exr(path, {name: plane[::-1] for name, plane in channels.items()}, about)


def write_swatch(fabric: Fabric, folder: Path, size: tuple[int, int]) -> Path:
    """Write a picture, (width, height) in pixels, of a lit swatch of 1.5 repeats or more; return its path."""
    from jobs.verbs.render import shown_at
    from pipeline.scenes import bounces, picture
    from pipeline.scenes.swatch import Swatch

    refuse_unwritable(path := folder / f"{fabric.name}-swatch.png")
    period = max(*fabric.weave.repeat, *(len(colours.diffuse) for colours in fabric.thread_colours()))
    swatch = Swatch(min(max(_LEAST_YARNS, 1.5 * period), _MOST_YARNS), size)
    parts, codes = picture.windows(size, _QUERIES_OF_PIXEL), np.zeros((size[1], size[0], 3), np.uint8)
    with Terminal().status("tables of the cloth"):
        method = method_of(fabric)
        method.prepare(fabric)
    with progress("swatch") as advance, ThreadPoolExecutor(cores()) as pool:
        between = partial(bounces.light_between, tables=bounces.tables_of(_WALKS))
        maker = picture.WindowMaker({"swatch": fabric.in_shades()}, method, pool, ("swatch",), between)
        for number, part in enumerate(maker.made(swatch.frame, parts), 1):
            codes[shown_at(part)] = tiles.displayed(part.planes["rgb"])
            advance(number / len(parts))
    atomic_write(path, tiles.png(tiles.opaque(codes), 1))
    return path


def method_of(fabric: Fabric) -> Fallback:
    """Return the method that answers for a swatch."""
    from pipeline.models.named import named_method

    many = fabric.weave.different_cells() > TABLE_CELLS
    return named_method(f"point_sampled:{_POINTS}" if many else "soft_nodes:2", "show", "method")


def _print_fabric(fabric: Fabric) -> None:
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
        warp, weft, diagonals = (f"{angle:.0f}° along the" for angle in closed[4:])
        print_lines(f"cut-off angle of light through the gaps: {warp} warp, {weft} weft, {diagonals} diagonals")
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
