"""Constants of the shader: those of pipeline.analytic, so that no number is typed twice."""

from __future__ import annotations

import math
from types import ModuleType
from typing import Final

import numpy as np

from pipeline.analytic import axis_densities, soft_horizons
from pipeline.analytic.soft_nodes import (
    answer,
    diamond,
    ellipse_nodes,
    footprint_nodes,
    groups,
    narrow,
    nodes,
    shade,
    waves,
    weights,
    wide,
)
from pipeline.compiled import float32
from pipeline.truth import query
from pipeline.truth.footprint import mixture
from pipeline.truth.geometry import heightfield
from pipeline.truth.scattering import slab_float32

COLUMNS: Final[dict[str, tuple[ModuleType, tuple[str, ...]]]] = {
    "YARN": (heightfield, ("RADIUS", "INVERSE_RADIUS", "SIN_TWIST", "COS_TWIST", "ALPHA", "BETA", "BLEND", "BEND")),
    "GROUP": (nodes, ("START", "LINES", "RULE_X", "RULE_Y", "GROUP_FAMILY")),
    "PIECE": (nodes, ("FAMILY", "BLOCK")),
    "BOUNDS": (nodes, ("X_LOW", "X_HIGH", "Y_LOW", "Y_HIGH", "SHIFT", "CURVE", "BOUND")),
}
"""Columns of the arrays of `pipeline.analytic.soft_nodes.nodes.Table`, by the name of the array."""

CELLS_OF_GROUP: Final = ("FIRST_CELL", "CELLS")
"""Two more columns of a group: the shader sums over the cells of a node, so that they are listed by group."""

TEXTURE_WIDTH: Final = 1024
"""Texels of a row of every texture."""

WAVE_ROW: Final = 4 + diamond.AZIMUTHS // 2
"""Row of a node from which on it has its waves."""

_SAME: Final[dict[ModuleType, tuple[str, ...]]] = {
    heightfield: ("WARP", "WEFT", "GAP"),
    diamond: ("AZIMUTHS",),
    groups: ("COLUMNS",),
    nodes: ("LEVELS", "UPPER"),
    shade: ("LEAST_SEEN", "FADED", "TINY"),
    answer: ("STRETCHED", "SMALLEST"),
    axis_densities: ("NARROW",),
    narrow: ("LONG",),
    footprint_nodes: ("REACH", "MOST_ACROSS", "HERMITE"),
    ellipse_nodes: ("MOST",),
    waves: ("MOST_WAVES",),
    wide: ("RESOLVED",),
    query: ("HIDDEN_SHARE",),
}
# What a file keeps to itself is read by name: a shader has it from there, and a new name there is an error here.
_RENAMED: Final[dict[ModuleType, dict[str, str]]] = {
    float32: {
        "DEEPEST": "_DEEPEST", "HALVINGS": "_HALVINGS", "LN2": "_LN2", "LN2_REST": "_LN2_REST",
        **{f"EXP_{n}": f"_C{n}" for n in range(2, 8)}, **{f"ASIN_{n}": f"_AS{n}" for n in range(4)},
    },
    soft_horizons: {"RAMP": "_RAMP", "RAMP_SLOPE": "_RAMP_SLOPE", "APART_TINY": "_TINY"},
    diamond: {"DIAMOND_TINY": "_TINY"},
    slab_float32: {"SLAB_TINY": "_TINY"},
    shade: {"SHORTEST": "_SHORTEST", "FLAKES": "_FLAKES", "GAUSS": "_GAUSS", "TAIL": "_TAIL"},
    footprint_nodes: {
        "HERMITE_BOX": "_HERMITE_BOX", "WHOLE": "_WHOLE", "VERTICAL": "_VERTICAL", "INVERSE_ROOT": "_INVERSE_ROOT",
        "OUTWARDS": "_OUTWARDS",
    },
    ellipse_nodes: {
        name: f"_{name}"
        for name in (
            "BETWEEN", "ALONG_YARNS", "CLOSER", "COARSEST", "CUT", "SLIGHT", "APART", "CUTS", "LENGTH", "MOST_BETWEEN",
            "NEAREST",
        )
    },
    narrow: {"HIDDEN": "_HIDDEN", "PARTS": "_PARTS", "FAR": "_FAR", "LEAST": "_LEAST"},
    weights: {"FAINTEST": "_FAINTEST"},
    wide: {
        "COST_WAVES": "_WAVES", "COST_WAVE": "_WAVE", "COST_DENSITIES": "_DENSITIES", "COST_DENSITY": "_DENSITY",
        "COST_PRODUCT": "_PRODUCT",
    },
    mixture: {"LITTLE": "_LITTLE", "WIDEST": "_WIDEST"},
}  # fmt: skip


def constants() -> dict[str, float | int]:
    """Return the constants of the shader, by name; those of type int are integers there."""
    line = mixture.COARSE_LINE
    found: dict[str, object] = {
        "TEXTURE_WIDTH": TEXTURE_WIDTH,
        "PI": math.pi,
        "INVERSE_PI": 1.0 / math.pi,
        "RIGHT": 0.5 * math.pi,
        "ROOT_3": math.sqrt(3.0),
        "GAUSS_COLUMNS": vars(footprint_nodes)["_GAUSS_PLACES"].shape[1],
        "WAVES_TOGETHER": waves.TOGETHER,
        "LINE_STEP": line.step,
        "LINE_REACH": line.reach,
        "LINE_TWO": line.two,
        "LINE_THREE": line.three,
        "LINE_HALF": line.half,
        "LINE_POINTS": float(line.points),
        "STRONGEST": line.most,
        **{f"NODE_{name}": row for row, name in enumerate(("NORMAL", "TANGENT", "ALONG", "ACROSS", "HORIZONS"))},
        "NODE_WAVES": WAVE_ROW,
    }
    for name, (module, columns) in COLUMNS.items():
        found |= {column: vars(module)[column] for column in columns}
        extra = CELLS_OF_GROUP if name == "GROUP" else ()
        found |= {column: len(columns) + index for index, column in enumerate(extra)}
        found[f"{name}_COLUMNS"] = len(columns) + len(extra)
    for module, names in _SAME.items():
        found |= {name: vars(module)[name] for name in names}
    for module, renamed in _RENAMED.items():
        found |= {name: vars(module)[own] for name, own in renamed.items()}
    return {name: value if isinstance(value, int) else float(np.float32(value)) for name, value in found.items()}  # type: ignore[arg-type]


def shared_constants() -> dict[str, float | int]:
    """Return the constants of common.slang."""
    found = constants()
    return {name: found[name] for name in ("TEXTURE_WIDTH", "TINY", *_RENAMED[float32])}
