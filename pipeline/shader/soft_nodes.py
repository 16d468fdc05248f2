"""Soft nodes as a shader."""

from __future__ import annotations

from collections.abc import Collection
from typing import Final

from pipeline.analytic.soft_nodes.groups import DETAILS, USUAL
from pipeline.shader.descriptor import Shader, descriptor
from pipeline.shader.golden import golden
from pipeline.shader.tables import layout_slang, refuse_large_repeat, table_files, tables, tabulate_sides
from weaves.errors import BadInput
from weaves.fabric import Fabric

SOFT_NODES: Final = "soft_nodes"
"""Name of the model."""

SOFT_NODES_SOURCES: Final = (
    "soft_nodes.slang", "importance.slang", "buffers.slang", "arithmetic.slang", "horizons.slang", "query.slang",
    "look.slang", "colours.slang", "threads.slang", "shade.slang", "pieces.slang", "fixed_nodes.slang",
    "seen_areas.slang", "view_rays.slang", "view_lines.slang", "coverage.slang",
)  # fmt: skip
"""Files of the source."""


def soft_nodes_shader(fabric: Fabric, level: int | None, kinds: Collection[str]) -> Shader:
    """Return the soft nodes of a fabric; BadInput if the level is none of DETAILS, or the cloth is too large."""
    level = USUAL if level is None else level
    if level not in DETAILS:
        raise BadInput("export", "level", level, f"must be one of {', '.join(map(str, DETAILS))}")
    refuse_large_repeat(fabric)
    sides = tabulate_sides(fabric, level, kinds)
    cloth = tables(sides)
    return Shader(
        SOFT_NODES,
        SOFT_NODES_SOURCES,
        {"layout.slang": layout_slang(cloth)},
        table_files(cloth),
        descriptor(fabric, level, cloth, kinds),
        golden(sides),
        f"level {level}, {sides.front.evenly.size} nodes",
        True,
        threads=max(map(len, sides.tints)) > 1,
    )
