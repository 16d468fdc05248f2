"""The table of a cloth as a shader reads it: four buffers, and the places of its arrays in them.

    integers   int32: scalars of `Table` in the order of `Tables.places`, then arrays
    numbers    float32: scalars, then the yarns, the extents of pieces, the rules along both axes and those of Gauss
    nodes      float32 (rows, 4), `stride` rows a node: normal and 1 / n_z; tangent and share of the area; change of the
               tangent along; across; mean and sharpness of horizons, two azimuths a row; cosine and sine of waves, two
               a row
    grid       uint8: horizons of the pieces, 255 straight above

`layout.slang` holds the constants and a function that reads the scalars and places.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from jobs.verbs.exchange.shader.constants import TEXTURE_WIDTH, WAVE_ROW, constants
from pipeline.analytic.soft_nodes import footprint_nodes
from pipeline.analytic.soft_nodes.diamond import AZIMUTHS
from pipeline.analytic.soft_nodes.groups import COLUMNS
from pipeline.analytic.soft_nodes.nodes import BLOCK_NODES, Table
from pipeline.analytic.soft_nodes.waves import TOGETHER
from pipeline.compiled.arrays import Float32
from weaves.errors import BadInput

MOST_NODES: Final = 1024
"""Most fixed nodes of a table, those that fill up blocks included."""

MOST_CELLS: Final = 1024
"""Most cells of a repeat, ends times picks."""

MOST_HEIGHT: Final = 2048
"""Most rows of a texture, which every WebGL 2 allows; of TEXTURE_WIDTH horizons in a grid."""


class Array(NamedTuple):
    """An array in a buffer: its first element there, its shape, and what it holds."""

    offset: int
    shape: tuple[int, ...]
    meaning: str


class Tables(NamedTuple):
    """A cloth for a shader.

    Attributes
    ----------
    integers, numbers : int32, float32
    nodes : float32 (rows, 4)
    grid : uint8
        The four buffers.
    scalars : dict
        Values of `Table` of type int, then of type float, in the order in which the buffers begin with them.
    places : dict
        Buffer and arrays in it, by name.
    """

    integers: npt.NDArray[np.int32]
    numbers: Float32
    nodes: Float32
    grid: npt.NDArray[np.uint8]
    scalars: dict[str, int | float]
    places: dict[str, dict[str, Array]]


_MEANINGS: Final = {
    "groups": "first node, lines of nodes, rules along x and y, family, first cell, number of cells",
    "group_cells": "end and pick of the cells of all groups",
    "piece_starts": "first piece of every cell, pick by pick; their end",
    "pieces": "family (0 warp, 1 weft, 2 gap) and grid of every piece",
    "wave_periods": "periods of every wave in a repeat, along x and y",
    "yarn": "warp, weft: radius, 1/radius, sine and cosine of the twist, roughness, relief, blend, largest bend",
    "bounds": "extent of every piece in x and y within its cell; offset, curve, largest sine of its inclination",
    "places_x": "nodes of the rules along x, within a cell",
    "weights_x": "their weights",
    "places_y": "nodes of the rules along y",
    "weights_y": "their weights",
    "wave_size": "squared wave numbers, 1/yarn spacings^2",
    "gauss_places": "Gauss-Legendre rules of 0 to 6 nodes, filled up to 8",
    "gauss_weights": "their weights",
    "hermite_places": "Gauss-Hermite rule, in deviations",
    "hermite_weights": "its weights",
}


def refuse_large(ends: int, picks: int) -> None:
    """Refuse a repeat of more than MOST_CELLS cells."""
    if ends * picks > MOST_CELLS:
        allowed = f"the shader takes repeats of at most {MOST_CELLS:,} cells"
        raise BadInput("export", "--shader", f"{ends} ends × {picks} picks", allowed)


def tables(table: Table) -> Tables:
    """Return the buffers of a cloth without threads of their own; BadInput above MOST_NODES or MOST_HEIGHT."""
    ends, picks = (int(n) for n in table.repeat)
    refuse_large(ends, picks)
    count = table.evenly.size
    if count > MOST_NODES:
        allowed = f"the shader takes at most {MOST_NODES:,}; choose a lower --level"
        raise BadInput("export", "--shader", f"{count:,} nodes", allowed)
    if table.grid.size > TEXTURE_WIDTH * MOST_HEIGHT:
        allowed = f"the shader takes at most {TEXTURE_WIDTH * MOST_HEIGHT:,}; choose a fabric of fewer different floats"
        raise BadInput("export", "--shader", f"{table.grid.size:,} horizons", allowed)
    rows = _node_rows(table)
    groups, cells = _groups(table)
    gauss_places, gauss_weights, hermite = _rules()
    integers = {
        "ends": ends,
        "picks": picks,
        "size": table.grid.shape[2],
        "per_azimuth": table.grid.shape[2] * table.grid.shape[3],
        "legendre": table.legendre,
        "blocks": len(table.evenly),
        "stride": rows.shape[1],
        "waves": len(table.waves),
        "rules_x": len(table.places_x) // COLUMNS,
        "rules_y": len(table.places_y) // COLUMNS,
        "group_count": len(groups),
    }
    floats = {
        "thickness": float(table.thickness),
        "uniform": table.uniform,
        "waves_from": table.waves_from,
        "lines_per_cell": table.lines_per_cell,
        "narrow": float(table.narrow),
    }
    of_integers: dict[str, npt.NDArray[Any]] = {
        "groups": groups,
        "group_cells": cells,
        "piece_starts": table.piece_starts,
        "pieces": table.pieces,
        "wave_periods": table.waves,
    }
    of_numbers: dict[str, npt.NDArray[Any]] = {
        "yarn": table.yarn,
        "bounds": table.bounds,
        "places_x": table.places_x,
        "weights_x": table.weights_x,
        "places_y": table.places_y,
        "weights_y": table.weights_y,
        "wave_size": table.wave_size,
        "gauss_places": gauss_places,
        "gauss_weights": gauss_weights,
        "hermite_places": hermite[0],
        "hermite_weights": hermite[1],
    }
    arrays = len(of_integers) + len(of_numbers)
    at_integers = _places(of_integers, len(integers) + arrays)
    at_numbers = _places(of_numbers, len(floats))
    offsets = {name: array.offset for name, array in (at_integers | at_numbers).items()}
    head = np.array([*integers.values(), *offsets.values()], np.int32)
    return Tables(
        np.concatenate([head, *(values.ravel() for values in of_integers.values())]).astype(np.int32),
        np.concatenate([[*floats.values()], *(values.ravel() for values in of_numbers.values())]).astype(np.float32),
        np.ascontiguousarray(rows.reshape(-1, 4), np.float32),
        table.grid.ravel(),
        {**integers, **offsets, **floats},
        {"integers": at_integers, "numbers": at_numbers},
    )


def constants_slang(values: Mapping[str, bool | int | float], origin: str) -> str:
    """Return a file of the source with constants, whose types are those of the values."""
    lines = [f"// Generated from {origin}; do not edit.", ""]
    for name, value in values.items():
        if isinstance(value, bool):
            kind, text = "bool", str(value).lower()
        else:
            kind, text = ("int", str(value)) if isinstance(value, int) else ("float", f"{value:.9g}")
        if kind == "float" and not any(mark in text for mark in ".e"):
            text += ".0"
        lines.append(f"static const {kind} {name} = {text};")
    return "\n".join([*lines, ""])


def layout_slang(found: Tables) -> str:
    """Return `layout.slang`, equal for all cloths: constants, the struct `Table`, and the function that reads it."""
    lines = [constants_slang(constants(), "pipeline.analytic.soft_nodes").rstrip()]
    kinds = {name: "int" if isinstance(value, int) else "float" for name, value in found.scalars.items()}
    lines += ["", "struct Table {", *(f"    {kind} {name};" for name, kind in kinds.items()), "};", ""]
    lines += ["int integer(int i);", "float number(int i);", "", "Table load_table() {", "    Table table;"]
    seen = {"int": 0, "float": 0}
    for name, kind in kinds.items():
        lines.append(f"    table.{name} = {'integer' if kind == 'int' else 'number'}({seen[kind]});")
        seen[kind] += 1
    return "\n".join([*lines, "    return table;", "}", ""])


def _places(arrays: dict[str, npt.NDArray[Any]], start: int) -> dict[str, Array]:
    """Return where arrays lie one after another."""
    found = {}
    for name, values in arrays.items():
        found[name] = Array(start, values.shape, _MEANINGS[name])
        start += values.size
    return found


def _node_rows(table: Table) -> Float32:
    """Return the rows of all nodes, (nodes, stride, 4)."""
    count, waves = table.evenly.size, len(table.waves)
    surface = table.nodes.transpose(0, 2, 1).reshape(count, -1)
    rows = np.zeros((count, WAVE_ROW + waves // 2, 4), np.float32)
    rows[:, 0] = surface[:, :4]
    rows[:, 1, :3], rows[:, 1, 3] = surface[:, 4:7], table.evenly.ravel()
    rows[:, 2, :3], rows[:, 3, :3] = surface[:, 7:10], surface[:, 10:13]
    horizons = np.stack([table.mean.reshape(AZIMUTHS, count), table.sharpness.reshape(AZIMUTHS, count)], axis=-1)
    rows[:, 4:WAVE_ROW] = horizons.transpose(1, 0, 2).reshape(count, -1, 4)
    # (blocks, H / TOGETHER, 2 TOGETHER, BLOCK_NODES): cosines and sines of one wave follow each other.
    of_waves = table.wave_nodes.reshape(-1, waves // TOGETHER, 2 * TOGETHER, BLOCK_NODES)
    rows[:, WAVE_ROW:] = of_waves.transpose(0, 3, 1, 2).reshape(count, -1, 4)
    return rows


def _groups(table: Table) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
    """Return the groups with their lists of cells, (G, 7), and these cells, (cells, 2)."""
    ends = int(table.repeat[0])
    starts = table.group_starts.astype(np.int64)
    of_cell = np.repeat(np.arange(len(starts) - 1), starts[1:] - starts[:-1])
    order = np.argsort(table.cell_groups, kind="stable")
    counts = np.bincount(table.cell_groups, minlength=len(table.groups))
    first = np.concatenate([[0], np.cumsum(counts)[:-1]])
    cells = np.stack([of_cell[order] % ends, of_cell[order] // ends], axis=1)
    return np.column_stack([table.groups, first, counts]).astype(np.int32), cells.astype(np.int32)


def _rules() -> tuple[Float32, Float32, Float32]:
    """Return places and weights of the rules of Gauss and Legendre, (7, 8), and the rule of Hermite, (2, 4)."""
    own = vars(footprint_nodes)
    count = footprint_nodes.HERMITE
    hermite = np.stack([own["_HERMITE_PLACES"][:count], own["_HERMITE_WEIGHTS"][:count]])
    return own["_GAUSS_PLACES"], own["_GAUSS_WEIGHTS"], hermite
