"""A page that draws a fabric live: one file that works from a disk, without a network.

It holds tables of several shapes and levels, views with their tiles, and a still picture.

Buffers are compressed by gzip and written in base64. A table is of one shape of the yarns, a factor of their bend and
one of their width: the own shape has every level that the shader takes, the others have the usual one.
"""

import base64
import gzip
import html
import itertools
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from pipeline.analytic.soft_nodes.components import read_queries
from pipeline.analytic.soft_nodes.groups import COLUMNS, DETAILS, USUAL
from pipeline.analytic.soft_nodes.nodes import GROUP_FAMILY, LINES, START, SoftNodeTable, tabulate
from pipeline.atomic import atomic_write, refuse_unwritable
from pipeline.compiled.arrays import Float64
from pipeline.models.method import Method
from pipeline.models.named import TRUTH, named_method
from pipeline.scenes.shade import coloured, colours, colours_of
from pipeline.shader.constants import TEXTURE_WIDTH
from pipeline.shader.limits import MOST_NODES
from pipeline.shader.tables import Sides, refuse_large_repeat, tables, tabulate_sides
from pipeline.shader.threads import thread_tints
from pipeline.truth.estimator import estimate
from pipeline.truth.geometry.heightfield import ALPHA, BETA, BLEND, COS_TWIST, GAP, SIN_TWIST
from pipeline.truth.options import TruthOptions
from reports.images.texture import png_bytes
from reports.options import LEAST_TILE, MOST_TILE
from reports.viewer.generate import KINDS, THREADS, shipped
from reports.viewer.shapes import HALF_ARC, HALF_HEIGHT, VIEW_SPREAD, Seen, Viewpoint, arcs, seen, sphere_radius
from weaves.errors import BadInput
from weaves.fabric import Fabric
from weaves.yarn import Yarn

SCRIPTS: Final = ("tables.js", "picture.js", "controls.js")
_HOME = Path(__file__).parent

VIEWS: Final = {
    "One yarn": Viewpoint("plane", 20.0, 60.0, 9.0, -50.0, 40.0, (2.0, 2.0)),
    "Cloth": Viewpoint("plane", 20.0, 45.0, 70.0, -50.0, 40.0, (2.0, 2.0)),
    "Horizon": Viewpoint("plane", 10.0, 7.0, 150.0, -50.0, 40.0, (2.0, 2.0)),
    "Sphere": Viewpoint("sphere", 15.0, 20.0, 215.0, -35.0, 45.0),
    "Drape": Viewpoint("drape", -20.0, 10.0, 620.0, -40.0, 40.0),
}
"""Views of the page, each with a picture of the truth."""

TILE: Final = "map_material"  # method that the page has as pictures at its views, beside the truth

AGAINST_LIGHT: Final = {"Against the light": Viewpoint("drape", -20.0, 6.0, 330.0, 165.0, 20.0)}
"""One more view of cloth that light comes through."""

STILL: Final = "Drape"  # view of the still picture, with which the page opens
STILL_SIZE: Final = 384
BEND_FACTORS: Final = (0.6, 1.0, 1.4)  # factors of the bends of both yarns
WIDTHS: Final = (0.8, 1.0, 1.25)
NARROWER: Final = (0.65, 0.8, 1.0)  # factors of the widths of both yarns: the second ones if yarns would overlap
STEEPEST_BEND: Final = 85.0  # largest bend of a yarn, degrees

TWISTED: Final = 30.0
"""Twist of the nodes of yarns without twist, in degrees: the page turns all nodes to the twist that it shows, and finds
their extent across the yarn from how their fibres turn, which they do not without twist."""

_FLAT, _FLAT_VIEW = "flat", "One yarn"  # tile of the truth with footprints of the fabric plane, and its view
_PRECISION = TruthOptions(relative_error=0.01)
_OF_PLANE = TruthOptions(relative_error=0.01, parallax=False)
_DARK = 0.012  # linear value behind sheer cloth, as in cloth.slang
_BRIGHT = 0.8  # linear value that few pixels of the still picture exceed


def write_page(
    fabric: Fabric, path: Path, truth: int = 160, progress: Callable[[float], None] = lambda share: None
) -> str:
    """Write the viewer of a fabric, whole or not at all, and return a sentence on it.

    `truth` counts the pixels along each side of tiles, pictures of the truth and other methods, from LEAST_TILE to
    MOST_TILE; 0: there are none. `progress` takes the share that is done, from 0 to 1. BadInput if the number cannot be
    used, or the repeat is too large for the shader.
    """
    if truth and not LEAST_TILE <= truth <= MOST_TILE:
        raise BadInput("export", "truth", truth, f"must be from {LEAST_TILE} to {MOST_TILE}, or 0 for none")
    refuse_large_repeat(fabric)
    refuse_unwritable(path)
    shown = content(fabric, truth, progress)
    page = whole_page(shown)
    atomic_write(path, page.encode())
    return f"{path}: {len(shown['tables'])} tables, {len(shown['views'])} views, {len(page) / 1e6:.1f} MB"


def whole_page(shown: dict[str, object]) -> str:
    """Return the page of a content."""
    parts = {
        "FABRIC": html.escape(str(shown["fabric"]).replace("_", " ")),
        "STILL": str(shown["still"]),
        "STYLE": _text("page.css"),
        **{name.upper(): shipped(name + (THREADS if shown["threads"] else "")) for name in KINDS},
        # No content can end the element.
        "CONTENT": json.dumps({key: value for key, value in shown.items() if key != "still"}).replace("<", "\\u003c"),
        "SCRIPT": "\n".join(_text(name) for name in SCRIPTS),
    }
    page = _text("page.html")
    for name, text in parts.items():
        page = page.replace("{{ " + name + " }}", text)
    return page


def _text(name: str) -> str:
    return (_HOME / name).read_text(encoding="utf-8")


def content(fabric: Fabric, truth: int, progress: Callable[[float], None] = lambda share: None) -> dict[str, Any]:
    """Return what the page shows of a fabric, ready for JSON; `truth` and `progress` as for `write_page`."""
    factors = bends(fabric), widths(fabric)
    of_shapes: list[dict[str, Any]] = []
    grids: list[str] = []
    pictures: list[dict[str, Any]] = []
    through = sheer(fabric)
    views = VIEWS | (AGAINST_LIGHT if through else {})
    steps = len(factors[0]) * len(factors[1]) + len(views)
    for bend, width in itertools.product(*factors):
        shape = bent(fabric, bend, width)
        of_shape = [(k, _nodes(shape, k)) for k in (DETAILS if (bend, width) == (1.0, 1.0) else [USUAL])]
        # All levels of a shape have the same grid; `end_walls`, which follow it, are of each level.
        about = {"bend": bend, "width": width, "grid": len(grids)}
        front = of_shape[0][1].front
        grids.append(packed(np.concatenate([front.grid.ravel(), front.behind_grid.ravel()])))
        of_shape = [pair for pair in of_shape if pair[1].front.evenly.size <= MOST_NODES]
        of_shapes += [_table(shape, sides, {"level": level, **about}) for level, sides in of_shape]
        progress(len(grids) / steps)
    still, irradiance = _still(fabric)
    methods = _methods(fabric) if truth else {}
    for name, camera in views.items():
        pictures.append(_view(fabric, name, camera, truth, methods))
        progress((len(grids) + len(pictures)) / steps)
    return {
        "fabric": fabric.name,
        "threads": max(map(len, thread_tints(fabric))) > 1,
        "through": through,
        "texture_width": TEXTURE_WIDTH,
        "colours": colours(fabric).tolist(),
        "warp": _yarn(fabric.warp),
        "weft": _yarn(fabric.weft),
        "thickness": fabric.optical_thickness,
        "bends": factors[0],
        "widths": factors[1],
        "columns": {"sin": SIN_TWIST, "cos": COS_TWIST, "roughness": ALPHA, "relief": BETA, "blend": BLEND},
        "gap": GAP,
        "tables": of_shapes,
        "grids": grids,
        "tiles": [*methods, _FLAT, TRUTH] if truth else [],
        "views": pictures,
        "start": list(VIEWS).index(STILL),
        "shapes": {
            "spread": VIEW_SPREAD,
            "radius": sphere_radius(fabric.weave.repeat[0]),
            "half_arc": HALF_ARC,
            "half_height": HALF_HEIGHT,
            "arcs": arcs().tolist(),
        },
        "irradiance": irradiance,
        "still": f"data:image/png;base64,{base64.b64encode(still).decode()}",
    }


def sheer(fabric: Fabric) -> bool:
    """Return whether light comes through a fabric: it has gaps, or yarns that transmit diffuse light."""
    yarns = (fabric.average().warp, fabric.average().weft)
    return all(yarn.width < 1.0 for yarn in yarns) or any(max(yarn.diffuse_transmission_rgb) > 0.0 for yarn in yarns)


def bends(fabric: Fabric) -> tuple[float, ...]:
    """Return the factors of the bends: 1 alone if the yarns are flat."""
    steepest = max(fabric.warp.bend, fabric.weft.bend)
    factors = BEND_FACTORS if steepest else (1.0,)
    return tuple(factor for factor in factors if factor <= 1.0 or steepest * factor <= STEEPEST_BEND)


def widths(fabric: Fabric) -> tuple[float, ...]:
    """Return the factors of the widths."""
    return WIDTHS if max(fabric.warp.width, fabric.weft.width) * max(WIDTHS) <= 1.0 else NARROWER


def bent(fabric: Fabric, bend: float, width: float) -> Fabric:
    """Return a fabric whose bends and widths are multiplied by factors."""
    yarns = {
        name: yarn.model_copy(update={"bend": yarn.bend * bend, "width": yarn.width * width})
        for name, yarn in (("warp", fabric.warp), ("weft", fabric.weft))
    }
    return fabric.model_copy(update=yarns)


def packed(values: npt.NDArray[Any]) -> str:
    """Return an array, little-endian, as gzip in base64."""
    return base64.b64encode(gzip.compress(values.astype(values.dtype.newbyteorder("<")).tobytes(), mtime=0)).decode()


def _nodes(fabric: Fabric, level: int) -> Sides:
    """Return the front of a fabric, with light from behind if sheer; yarns without twist as if they had TWISTED."""
    yarns = {"warp": fabric.warp, "weft": fabric.weft}
    turned = {name: yarn.model_copy(update={"twist": _twist(yarn)}) for name, yarn in yarns.items()}
    cloth = fabric.model_copy(update=turned)
    sides = tabulate_sides(cloth, level, ())
    return sides._replace(front=tabulate(cloth, behind=True, level=level)) if sheer(fabric) else sides


def _twist(yarn: Yarn) -> float:
    return yarn.twist if abs(yarn.twist) >= 1.0 else TWISTED


def _table(fabric: Fabric, sides: Sides, about: dict[str, Any]) -> dict[str, Any]:
    cloth, table = tables(sides), sides.front
    return about | {
        "bends": (fabric.warp.bend, fabric.weft.bend),
        "widths": (fabric.warp.width, fabric.weft.width),
        "twists": (_twist(fabric.warp), _twist(fabric.weft)),
        "count": int(table.evenly.size),
        "stride": cloth.scalars["stride"],
        "yarn": cloth.places["numbers"]["yarn"].offset,
        "yarn_columns": cloth.places["numbers"]["yarn"].shape[1],
        "thickness": [*(name for name, value in cloth.scalars.items() if isinstance(value, float))].index("thickness"),
        "integers": packed(cloth.integers),
        "numbers": packed(cloth.numbers),
        "nodes": packed(cloth.nodes),
        "end_walls": packed(table.end_walls),
        "families": packed(_families(table)),
    }


def _families(table: SoftNodeTable) -> npt.NDArray[np.uint8]:
    """Return the family of every node; those that fill up blocks count as gaps."""
    families = np.full(table.evenly.size, GAP, np.uint8)
    for group in table.groups.astype(np.int64):
        families[group[START] : group[START] + COLUMNS * group[LINES]] = group[GROUP_FAMILY]
    return families


def _yarn(yarn: Yarn) -> dict[str, float]:
    return {"roughness": yarn.roughness, "twist": yarn.twist, "blend": yarn.blend}


def _methods(fabric: Fabric) -> dict[str, Method]:
    """Return the method of `TILE` by its name; none if it cannot answer for the fabric: its repeat is too large."""
    method = named_method(TILE, "view", "")
    try:
        method.prepare(fabric)
    except BadInput:
        return {}
    return {TILE: method}


def _view(fabric: Fabric, name: str, camera: Viewpoint, size: int, methods: dict[str, Method]) -> dict[str, Any]:
    """Return a view with its tiles: components as half floats, -1 where there is no cloth, row 0 the lowest."""
    view: dict[str, Any] = {"name": name, **camera._asdict(), "size": size}
    if size:
        ends = fabric.weave.repeat[0]
        picture = seen(camera, size, ends, sheer(fabric))
        answers = estimate(fabric, picture.queries.raised(), _PRECISION, 0)
        shown = colours(fabric)
        deviation = np.sqrt(np.square(answers.standard_error.astype(np.float64)) @ np.square(shown))
        tiles = {key: method.predict(fabric, picture.queries) for key, method in methods.items()}
        tiles[TRUTH] = answers.mean
        if name == _FLAT_VIEW:
            tiles[_FLAT] = estimate(fabric, picture.queries, _OF_PLANE, 0).mean
        view["tiles"] = {key: packed(_components(picture, tile).astype(np.float16)) for key, tile in tiles.items()}
        view["standard_error"] = float(np.sqrt(np.square(deviation).mean()) / (answers.mean @ shown).mean())
    return view


def _components(picture: Seen, values: npt.NDArray[np.floating]) -> Float64:
    """Return components in their pixels, (H, W, 4): 0 where nothing lights the cloth, -1 where there is none."""
    whole = np.where(picture.cloth, 0.0, -1.0)[..., None] * np.ones(4)
    whole[picture.lit] = values
    return whole


def _still(fabric: Fabric) -> tuple[bytes, float]:
    """Return a picture by soft nodes as PNG, and the irradiance at which it is neither dark nor glaring."""
    picture = seen(VIEWS[STILL], STILL_SIZE, fabric.weave.repeat[0])
    components = read_queries(tabulate(fabric), picture.queries).components
    values = coloured(components, colours_of(fabric, picture.queries))
    irradiance = float(_BRIGHT / max(np.percentile(values.max(axis=1), 97.0), 1e-6))
    pixels = np.zeros((*picture.cloth.shape, 4))
    if sheer(fabric):
        pixels[:] = (*[_DARK] * 3, 1.0)
    pixels[picture.cloth] = (0.0, 0.0, 0.0, 1.0)
    pixels[picture.lit, :3] = np.minimum(irradiance * values, 1.0)
    return png_bytes(pixels, "colour"), irradiance
