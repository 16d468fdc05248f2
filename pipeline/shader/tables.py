"""The table of a cloth as a shader reads it: four buffers, and the places of its arrays in them.

    integers   int32: scalars of `SoftNodeTable`, of the front and of the back, then arrays
    numbers    float32: scalars, then colours, yarns, extents of pieces, the rules along both axes and those of Gauss
    nodes      float32 (rows, 4), `stride` rows a node: normal and 1 / n_z; tangent and share of the area; change of the
               tangent along; across; mean and sharpness of horizons, two azimuths a row; the horizons of the other
               side, if known; falls over curved cloth, if known, four azimuths a row; areas that a viewer sees, four
               azimuths a row, angle by angle
    grid       uint8: horizons of the pieces, 255 straight above; those of the other side; falls; of all nodes the share
               of the area that light from behind does not reach, 255 all of it; the same of the back

`layout.slang` holds the constants and a function that reads the scalars and places.
"""

import io
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt
from PIL import Image

from pipeline.analytic.coverage import ray_points
from pipeline.analytic.importance.lobes import point_places
from pipeline.analytic.soft_horizons import AZIMUTHS
from pipeline.analytic.soft_nodes.nodes import SoftNodeTable, tabulate
from pipeline.analytic.soft_nodes.seen_areas import SEEN_ANGLES
from pipeline.analytic.soft_nodes.view_lines import GAUSS_PLACES, GAUSS_WEIGHTS
from pipeline.compiled.arrays import Float32
from pipeline.scenes.shade import colours
from pipeline.shader.constants import FALL_ROWS, OTHER_ROW, POINTS, TEXTURE_WIDTH, constants
from pipeline.shader.languages import refuse_unknown
from pipeline.shader.limits import MOST_HEIGHT, MOST_NODES, MOST_REPEAT_CELLS
from pipeline.shader.threads import family_heights, thread_tints
from pipeline.truth.geometry.heightfield import AXIS_DROP, BEND_RADIUS, HALF_LENGTH
from pipeline.truth.query import Queries
from weaves.errors import BadInput
from weaves.fabric import Fabric

BEHIND: Final = "behind"
CURVATURE: Final = "curvature"
QUERY_KINDS: Final = (BEHIND, CURVATURE)
"""Kinds of queries beside light and viewer in front of flat cloth, as `pipeline.models` names them."""

EVERY: Final = "all"  # all of QUERY_KINDS


class Sides(NamedTuple):
    """Tables of a cloth: its front, and its back if viewers behind it are wanted.

    `colours`, (6, 3), are k_s, k_d and k_dt, each of warp and weft, linear RGB; `tints` those of `thread_tints`.
    """

    front: SoftNodeTable
    back: SoftNodeTable | None
    colours: Float32
    tints: tuple[Float32, Float32]

    def seen(self, queries: Queries) -> tuple[SoftNodeTable, Queries]:
        """Return the table of the side that all viewers of N queries see, and the queries as that side has them."""
        if queries.wo[0, 2] >= 0.0:
            return self.front, queries
        assert self.back is not None
        return self.back, queries.turned()


@dataclass(frozen=True)
class Place:
    """An array in a buffer: its first element there, its shape (row-major), and what it holds."""

    offset: int
    shape: tuple[int, ...]
    meaning: str


class ClothTables(NamedTuple):
    """The four buffers of a cloth.

    `scalars` and `back_scalars` are values of the table of type int, then of type float, in the order in which the
    buffers begin with them: of the front, then of the back, if known. `places` has the arrays of each buffer.
    """

    integers: npt.NDArray[np.int32]
    numbers: Float32
    nodes: Float32
    grid: npt.NDArray[np.uint8]
    scalars: dict[str, int | float]
    back_scalars: dict[str, int | float]
    places: dict[str, dict[str, Place]]


_MEANINGS: Final = {
    "groups": "first node, lines of nodes, family, first cell, number of cells",
    "group_cells": "end and pick of the cells of all groups",
    "piece_starts": "first piece of every cell, pick by pick; their end",
    "pieces": "family (0 warp, 1 weft, 2 gap) and grid of every piece",
    "colours": "linear Rec. 709: k_s, k_d and k_dt, each of warp and weft",
    "tints": "of ends, then picks: factors on k_s, k_d and k_dt, integrals of them less 1 up to the thread",
    "floats": "of every piece: bend radius, half length, drop of its float; greatest height of its cell",
    "spots": "of every line of nodes: places in x and y in the cell, shares of it, heights",
    "ray_points": "rays of the coverage: deviations along both axes of a footprint",
    "point_places": "points of the lobes: in deviations of a footprint; in repeats, where it covers the cloth evenly",
    "yarn": "warp, weft: radius, 1/radius, sine and cosine of the twist, roughness, relief, blend, largest bend",
    "bounds": "extent of every piece in x and y within its cell; offset, curve, largest sine of its inclination",
    "gauss_places": "Gauss-Legendre rules of 0 to 6 nodes, filled up to 8",
    "gauss_weights": "their weights",
}


def wanted_kinds(names: Collection[str]) -> frozenset[str]:
    """Return the kinds of queries that names choose; BadInput if one is none."""
    refuse_unknown("kind", names, (*QUERY_KINDS, EVERY))
    return frozenset(QUERY_KINDS if EVERY in names else names)


def tabulate_sides(fabric: Fabric, level: int, kinds: Collection[str], rims: bool = True) -> Sides:
    """Return the tables of a fabric at a level of detail, for kinds of queries; `rims` as for `tabulate`."""
    behind, curved = BEHIND in kinds, CURVATURE in kinds
    reflected, transmitted = colours(fabric), colours(fabric, transmitted=True)
    return Sides(
        tabulate(fabric, behind=behind, level=level, curved=curved, rims=rims),
        tabulate(fabric.back(), behind=True, level=level, rims=rims) if behind else None,
        np.concatenate([reflected, transmitted[2:]]).astype(np.float32),
        thread_tints(fabric),
    )


def refuse_large_repeat(fabric: Fabric) -> None:
    """Refuse a repeat of more than MOST_REPEAT_CELLS cells, before it is tabulated."""
    picks, ends = fabric.weave.warp_over.shape
    if ends * picks > MOST_REPEAT_CELLS:
        allowed = f"the shader takes repeats of at most {MOST_REPEAT_CELLS:,} cells"
        raise BadInput("export", "", f"{fabric.name}: {ends} ends × {picks} picks", allowed)


def tables(sides: Sides) -> ClothTables:
    """Return the buffers of a cloth; BadInput above MOST_NODES or MOST_HEIGHT."""
    known = [_side(table, sides.tints) for table in (sides.front, sides.back) if table is not None]
    if (count := max(len(side.rows) for side in known)) > MOST_NODES:
        allowed = f"the shader takes at most {MOST_NODES:,}; choose a lower level"
        raise BadInput("export", "shader", f"{count:,} nodes", allowed)
    if (size := sum(len(side.grid) for side in known)) > TEXTURE_WIDTH * MOST_HEIGHT:
        allowed = f"the shader takes at most {TEXTURE_WIDTH * MOST_HEIGHT:,}; choose a fabric of fewer different floats"
        raise BadInput("export", "shader", f"{size:,} horizons", allowed)
    tints = np.concatenate(sides.tints)
    shared = {"colours": sides.colours, "point_places": point_places(POINTS), "tints": tints}
    first = known[0]
    own = len(first.integers) + 2 + len(first.of_integers) + len(first.of_numbers) + len(shared)
    integers, numbers = PlacedArrays(own * len(known)), PlacedArrays(len(first.numbers) * len(known))
    of_shared = _added(numbers, shared)
    heads: list[dict[str, int | float]] = []
    node = grid = 0
    for prefix, side in zip(("", "back_"), known, strict=False):
        offsets = _added(integers, side.of_integers, prefix) | _added(numbers, side.of_numbers, prefix) | of_shared
        heads.append({**side.integers, "first_node": node, "first_grid": grid, **offsets, **side.numbers})
        node, grid = node + side.rows[..., 0].size, grid + side.grid.size
    return ClothTables(
        np.concatenate([_values(heads, int), *integers.parts]).astype(np.int32),
        np.concatenate([_values(heads, float), *numbers.parts]).astype(np.float32),
        np.ascontiguousarray(np.concatenate([side.rows.reshape(-1, 4) for side in known]), np.float32),
        np.concatenate([side.grid for side in known]),
        heads[0],
        heads[1] if len(heads) > 1 else {},
        {"integers": integers.places, "numbers": numbers.places},
    )


class PlacedArrays:
    """Arrays of a buffer, one after another, from the element `count` on; an element has so many `channels`."""

    def __init__(self, count: int = 0, channels: int = 1) -> None:
        self.count, self._channels = count, channels
        self.places: dict[str, Place] = {}
        self.parts: list[npt.NDArray[Any]] = []

    def add(self, name: str, values: npt.NDArray[Any], meaning: str) -> Place:
        """Append an array whose last axis is filled up to whole elements, and return its place."""
        filled = np.pad(values, [(0, 0)] * (values.ndim - 1) + [(0, -values.shape[-1] % self._channels)])
        self.places[name] = Place(self.count, filled.shape, meaning)
        self.parts.append(filled.ravel())
        self.count += filled.size // self._channels
        return self.places[name]


def _added(buffer: PlacedArrays, arrays: dict[str, npt.NDArray[Any]], prefix: str = "") -> dict[str, int]:
    """Add arrays to a buffer; return their first elements by name."""
    about = "of the back: " if prefix else ""
    return {name: buffer.add(prefix + name, values, about + _MEANINGS[name]).offset for name, values in arrays.items()}


def _values(heads: list[dict[str, int | float]], kind: type) -> list[int | float]:
    return [value for head in heads for value in head.values() if isinstance(value, kind)]


class _Side(NamedTuple):
    """One side of a cloth: its scalars and arrays by name, the rows of its nodes, its grids."""

    integers: dict[str, int | float]
    numbers: dict[str, int | float]
    of_integers: dict[str, npt.NDArray[Any]]
    of_numbers: dict[str, npt.NDArray[Any]]
    rows: Float32
    grid: npt.NDArray[np.uint8]


def _side(table: SoftNodeTable, tints: tuple[Float32, Float32]) -> _Side:
    rows = _node_rows(table)
    groups, cells = _groups(table)
    grid = np.concatenate([table.grid.ravel(), table.behind_grid.ravel(), table.grid_falls.ravel()])
    behind, curvatures = int(len(table.behind_grid) > 0), len(table.grid_falls)
    integers: dict[str, int | float] = {
        "ends": int(table.repeat[0]),
        "picks": int(table.repeat[1]),
        "size": table.grid.shape[2],
        "per_azimuth": table.grid.shape[2] * table.grid.shape[3],
        "grid_size": table.grid.size,
        "stride": rows.shape[1],
        "group_count": len(groups),
        "behind": behind,
        "curvatures": curvatures,
        "behind_row": OTHER_ROW,
        "falls_row": OTHER_ROW + behind * (AZIMUTHS // 2),
        "areas_row": rows.shape[1] - SEEN_ANGLES * FALL_ROWS,
        "rims": int(table.rims),
        "node_count": table.evenly.size,
        "end_walls": len(grid) if len(table.end_walls) else 0,
        "end_tints": len(tints[0]),
        "pick_tints": len(tints[1]),
    }
    numbers: dict[str, int | float] = {"thickness": float(table.thickness)}
    numbers |= {name: getattr(table, name) for name in ("uniform", "highest", "lowest", "plane")}
    numbers |= zip(("shown_least", "shown_greatest"), map(float, table.shown), strict=True)
    numbers |= {name: getattr(table, name) for name in ("view_lines", "spacing")}
    numbers |= zip(("warp_height", "weft_height"), family_heights(table), strict=True)
    of_integers: dict[str, npt.NDArray[Any]] = {"groups": groups, "group_cells": cells}
    of_integers |= {"piece_starts": table.piece_starts, "pieces": table.pieces}
    floats = np.column_stack([table.floats[:, [BEND_RADIUS, HALF_LENGTH, AXIS_DROP]], table.crowns])
    of_numbers: dict[str, npt.NDArray[Any]] = {
        "yarn": table.yarn,
        "bounds": table.bounds,
        "floats": floats.astype(np.float32),
        "spots": table.spots,
        "ray_points": ray_points(),
        "gauss_places": GAUSS_PLACES,
        "gauss_weights": GAUSS_WEIGHTS,
    }
    return _Side(integers, numbers, of_integers, of_numbers, rows, np.append(grid, table.end_walls.ravel()))


def constants_slang(values: Mapping[str, bool | int | float], origin: str) -> str:
    """Return a file of the source with constants, whose types are those of the values."""
    lines = [f"// Generated from {origin}; do not edit.", "", "#pragma once", ""]
    for name, value in values.items():
        text = f"{value:.9g}" if isinstance(value, float) else str(value).lower()
        if isinstance(value, float) and not any(mark in text for mark in ".e"):
            text += ".0"
        lines.append(f"static const {type(value).__name__} {name} = {text};")
    return "\n".join([*lines, ""])


def layout_slang(cloth: ClothTables) -> str:
    """Return `layout.slang`, equal for all cloths: constants, the struct `Table`, and the functions that read it."""
    lines = [constants_slang(constants(), "pipeline.analytic").rstrip()]
    integers = [name for name, value in cloth.scalars.items() if isinstance(value, int)]
    numbers = [name for name, value in cloth.scalars.items() if isinstance(value, float)]
    lines += ["", "struct Table {", *(f"    int {name};" for name in integers)]
    lines += [*(f"    float {name};" for name in numbers), "};", ""]
    lines += ["int integer(int i);", "float number(int i);", ""]
    lines += ["Table load_table_at(int first_integer, int first_number) {", "    Table table;"]
    lines += [f"    table.{name} = integer(first_integer + {n});" for n, name in enumerate(integers)]
    lines += [f"    table.{name} = number(first_number + {n});" for n, name in enumerate(numbers)]
    lines += ["    return table;", "}", "", "/// The front of the cloth.", "Table load_table() {"]
    lines += ["    return load_table_at(0, 0);", "}", "", "/// The side that a viewer sees, if the table knows both."]
    lines += ["Table load_side(bool back) {", f"    bool other = back && integer({integers.index('behind')}) > 0;"]
    lines += [f"    return load_table_at(other ? {len(integers)} : 0, other ? {len(numbers)} : 0);", "}", ""]
    return "\n".join(lines)


def _node_rows(table: SoftNodeTable) -> Float32:
    """Return the rows of all nodes, (nodes, stride, 4)."""
    count = table.evenly.size
    surface = table.nodes.transpose(0, 2, 1).reshape(count, -1)
    first = np.zeros((count, 4, 4), np.float32)
    first[:, 0] = surface[:, :4]
    first[:, 1, :3], first[:, 1, 3] = surface[:, 4:7], table.evenly.ravel()
    first[:, 2, :3], first[:, 3, :3] = surface[:, 7:10], surface[:, 10:13]
    parts = [first, _horizon_rows(table.mean, table.sharpness)]
    if len(table.behind_grid):
        parts.append(_horizon_rows(table.behind_mean, table.behind_sharpness))
    for by_azimuth in (table.falls, table.areas.swapaxes(0, 1)):
        parts.append(by_azimuth.reshape(-1, count).T.reshape(count, -1, 4))
    return np.concatenate(parts, axis=1)


def _horizon_rows(mean: Float32, sharpness: Float32) -> Float32:
    """Return horizons, (AZIMUTHS, B, BLOCK_NODES), as rows of nodes, (nodes, AZIMUTHS / 2, 4)."""
    pairs = np.stack([mean.reshape(AZIMUTHS, -1), sharpness.reshape(AZIMUTHS, -1)], axis=-1)
    return pairs.transpose(1, 0, 2).reshape(pairs.shape[1], -1, 4)


def _groups(table: SoftNodeTable) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
    """Return the groups with their lists of cells, (G, 5), and these cells, (cells, 2)."""
    ends = int(table.repeat[0])
    starts = table.group_starts.astype(np.int64)
    of_cell = np.repeat(np.arange(len(starts) - 1), starts[1:] - starts[:-1])
    order = np.argsort(table.cell_groups, kind="stable")
    counts = np.bincount(table.cell_groups, minlength=len(table.groups))
    first = np.concatenate([[0], np.cumsum(counts)[:-1]])
    cells = np.stack([of_cell[order] % ends, of_cell[order] // ends], axis=1)
    return np.column_stack([table.groups, first, counts]).astype(np.int32), cells.astype(np.int32)


def encoded(values: npt.NDArray[Any], kind: str) -> bytes:
    """Return the file of a buffer: numbers of a type, little-endian; those of ``uint8`` as grey levels of a picture."""
    if kind != "uint8":
        return values.astype(np.dtype(kind).newbyteorder("<")).tobytes()
    # The lowest row of the texture comes first.
    rows = np.pad(values, (0, -values.size % TEXTURE_WIDTH)).reshape(-1, TEXTURE_WIDTH)
    picture = io.BytesIO()
    Image.fromarray(rows).save(picture, format="PNG", compress_level=9)
    return picture.getvalue()
