"""Soft nodes as a shader."""

from __future__ import annotations

import io
from collections.abc import Collection
from typing import Final

import numpy as np
import numpy.typing as npt
from PIL import Image

from pipeline.analytic.soft_nodes.detail import DETAILS, USUAL
from pipeline.shader.constants import TEXTURE_WIDTH
from pipeline.shader.descriptor import descriptor
from pipeline.shader.golden import golden
from pipeline.shader.shader import Shader
from pipeline.shader.sides import Sides, tabulate_sides
from pipeline.shader.tables import Tables, layout_slang, refuse_large, tables
from weaves.errors import BadInput
from weaves.fabric import Fabric

NAME: Final = "soft_nodes"
"""Name of the model."""

SOURCES: Final = (
    "soft_nodes.slang", "importance.slang", "buffers.slang", "arithmetic.slang", "horizons.slang", "query.slang",
    "look.slang", "colours.slang", "shade.slang", "fixed_nodes.slang", "placed_nodes.slang",
)  # fmt: skip
"""Files of the source."""


def soft_nodes_shader(fabric: Fabric, level: int | None, kinds: Collection[str]) -> Shader:
    """Return the soft nodes of a fabric.

    Parameters
    ----------
    fabric : Fabric
        The cloth.
    level : int, optional
        Level of detail k, one of DETAILS; the usual one if left out.
    kinds : collection of str
        Of KINDS.

    Raises
    ------
    BadInput
        If the level is none, or the cloth is too large.
    """
    level = USUAL if level is None else level
    if level not in DETAILS:
        raise BadInput("export", "--level", level, f"must be one of {', '.join(map(str, DETAILS))}")
    refuse_large_repeat(fabric)
    sides = tabulate_sides(fabric, level, kinds)
    found = tables(sides)
    return Shader(
        NAME,
        SOURCES,
        {"layout.slang": layout_slang(found)},
        table_files(found),
        descriptor(fabric, level, found, kinds),
        golden(sides),
        size_of(level, sides),
        True,
    )


def refuse_large_repeat(fabric: Fabric) -> None:
    """Refuse a repeat of too many cells, before it is tabulated."""
    picks, ends = fabric.weave.warp_over.shape
    refuse_large(ends, picks)


def size_of(level: int, sides: Sides) -> str:
    """Return words on the size of the tables."""
    return f"level {level}, {sides.front.evenly.size} nodes"


def _png(rows: npt.NDArray[np.uint8]) -> bytes:
    """Return rows of bytes as a picture; the lowest row of the texture comes first."""
    buffer = io.BytesIO()
    Image.fromarray(rows).save(buffer, format="PNG", compress_level=4)
    return buffer.getvalue()


def table_files(found: Tables) -> dict[str, bytes]:
    """Return the files of the four buffers, by their paths."""
    rows = np.pad(found.grid, (0, -found.grid.size % TEXTURE_WIDTH)).reshape(-1, TEXTURE_WIDTH)
    return {
        "tables/integers.i32": found.integers.astype("<i4").tobytes(),
        "tables/numbers.f32": found.numbers.astype("<f4").tobytes(),
        "tables/nodes.f32": found.nodes.astype("<f4").tobytes(),
        "tables/nodes.f16": found.nodes.astype("<f2").tobytes(),
        "tables/grid.png": _png(rows),
    }
