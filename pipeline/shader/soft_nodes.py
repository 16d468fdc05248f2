"""Soft nodes as a shader."""

from collections.abc import Collection
from typing import Final

from pipeline.analytic.soft_nodes.groups import DETAILS, USUAL
from pipeline.shader.descriptor import Buffer, Descriptor, Shader, colours
from pipeline.shader.golden import golden
from pipeline.shader.limits import MOST_NODES, MOST_REPEAT_CELLS
from pipeline.shader.tables import encoded, layout_slang, refuse_large_repeat, tables, tabulate_sides
from weaves.errors import BadInput
from weaves.fabric import Fabric

SOFT_NODES: Final = "soft_nodes"  # name of the model

SOFT_NODES_SOURCES: Final = (
    "soft_nodes.slang", "importance.slang", "buffers.slang", "arithmetic.slang", "horizons.slang", "query.slang",
    "look.slang", "colours.slang", "threads.slang", "shade.slang", "pieces.slang", "fixed_nodes.slang",
    "seen_areas.slang", "view_rays.slang", "view_lines.slang", "coverage.slang",
)  # fmt: skip
"""Files of the source."""

_BUFFERS: Final = {
    "integers": (1, {"int32": "tables/integers.i32"}),
    "numbers": (1, {"float32": "tables/numbers.f32"}),
    "nodes": (4, {"float32": "tables/nodes.f32", "float16": "tables/nodes.f16"}),
    "grid": (1, {"uint8": "tables/grid.png"}),
}
"""Channels and files of each buffer, by type, as `encoded` writes them: row after row."""


def soft_nodes_shader(fabric: Fabric, level: int | None, kinds: Collection[str]) -> Shader:
    """Return the soft nodes of a fabric; BadInput if the level is none of DETAILS, or the cloth is too large."""
    level = USUAL if level is None else level
    if level not in DETAILS:
        raise BadInput("export", "level", level, f"must be one of {', '.join(map(str, DETAILS))}")
    refuse_large_repeat(fabric)
    sides = tabulate_sides(fabric, level, kinds)
    cloth = tables(sides)
    threads, buffers = (len(sides.tints[0]), len(sides.tints[1])), {}
    contents: dict[str, bytes] = {}
    for name, (channels, files) in _BUFFERS.items():
        values, arrays = getattr(cloth, name), cloth.places.get(name, {})
        buffers[name] = Buffer(files=files, channels=channels, elements=values.size // channels, arrays=arrays)
        contents |= {path: encoded(values, kind) for kind, path in files.items()}
    described = Descriptor(
        fabric=fabric.name,
        level=level,
        colours=colours(fabric),
        repeat=fabric.weave.repeat,
        threads=threads,
        limits={"nodes": MOST_NODES, "cells": MOST_REPEAT_CELLS},
        kinds=sorted(kinds),
        scalars=cloth.scalars,
        back_scalars=cloth.back_scalars,
        buffers=buffers,
    )
    return Shader(
        SOFT_NODES_SOURCES,
        {"layout.slang": layout_slang(cloth)},
        contents,
        described,
        golden(sides),
        f"level {level}, {sides.front.evenly.size} nodes",
        True,
        threads=max(threads) > 1,
    )
