"""Constants of the shader: those of pipeline.analytic, so that no number is typed twice."""

import inspect
import math
from types import ModuleType
from typing import Final

import numpy as np

from pipeline.analytic import coverage, soft_horizons
from pipeline.analytic.importance import lobes
from pipeline.analytic.importance import mixture as importance_mixture
from pipeline.analytic.soft_nodes import (
    answer,
    groups,
    line_nodes,
    nodes,
    scratch,
    seen_areas,
    shade,
    view_lines,
    view_rays,
    wide,
)
from pipeline.compiled import float32
from pipeline.models.patch_bsdf import PatchBSDF
from pipeline.shader import threads
from pipeline.truth import query
from pipeline.truth.footprint import mixture
from pipeline.truth.geometry import heightfield, visibility
from pipeline.truth.scattering import slab_float32
from weaves.colour import LUMINANCE

ARRAYS: Final[dict[str, tuple[ModuleType, tuple[str, ...], tuple[str, ...]]]] = {
    "YARN": (heightfield, ("RADIUS", "INVERSE_RADIUS", "SIN_TWIST", "COS_TWIST", "ALPHA", "BETA", "BLEND", "BEND"), ()),
    # The shader sums over the cells of a node, so that they are listed by group.
    "GROUP": (nodes, ("START", "LINES", "GROUP_FAMILY"), ("FIRST_CELL", "CELLS")),
    "PIECE": (nodes, ("FAMILY", "BLOCK"), ()),
    "BOUNDS": (nodes, ("X_LOW", "X_HIGH", "Y_LOW", "Y_HIGH", "SHIFT", "CURVE", "BOUND"), ()),
    "FLOAT": (nodes, (), ("FLOAT_BEND", "FLOAT_HALF", "FLOAT_DROP", "CROWN")),
}
"""Columns of arrays: those of `pipeline.analytic.soft_nodes.nodes.SoftNodeTable`, then what only the shader has."""

TEXTURE_WIDTH: Final = 1024  # texels of a row of every texture
OTHER_ROW: Final = 4 + soft_horizons.AZIMUTHS // 2  # row of a node from which on it has what not all tables know
FALL_ROWS: Final = soft_horizons.AZIMUTHS // 4  # rows of a node for the falls of one curvature

LEVEL_TINY: Final = 1e-18
"""Squared length along the fabric plane below which a direction is the normal (pipeline.truth.geometry.march)."""

_SAMPLER: Final = inspect.signature(PatchBSDF).parameters
POINTS: Final[int] = _SAMPLER["points"].default
WIDENING: Final[float] = _SAMPLER["widening"].default
"""Points of a footprint that have a lobe each; factor on the widening of lobes by the spread of the tangents."""

_SAME: Final[tuple[tuple[ModuleType, tuple[str, ...]], ...]] = (
    (heightfield, ("WARP", "WEFT", "GAP")), (soft_horizons, ("AZIMUTHS",)), (groups, ("COLUMNS",)),
    (nodes, ("LEVELS", "UPPER")), (shade, ("LEAST_SEEN", "FADED", "TINY")), (answer, ("LONGEST",)),
    (mixture, ("SMALLEST",)), (view_lines, ("MOST_GAUSS",)), (view_rays, ("FOOTPRINT_ENDS", "NEVER", "NEAREST")),
    (wide, ("RESOLVED",)), (scratch, ("MOST_ON_LINES",)), (query, ("LOWEST_VIEWER",)),
    (seen_areas, ("SEEN_ANGLES",)), (coverage, ("RAYS",)), (soft_horizons, ("FALL",)), (lobes, ("SCATTERED", "BROAD")),
    (importance_mixture, ("LEAST_COSINE",)), (threads, ("TINT_COLUMNS", "SPREAD_OUT", "BELL_ENDS")),
)  # fmt: skip
# What a file keeps to itself is read by name: a shader has it from there, and a new name there is an error here.
_RENAMED: Final[dict[ModuleType, dict[str, str]]] = {
    float32: {
        "DEEPEST": "_DEEPEST", "HALVINGS": "_HALVINGS", "LN2": "_LN2", "LN2_REST": "_LN2_REST",
        **{f"EXP_{n}": f"_C{n}" for n in range(2, 8)}, **{f"ASIN_{n}": f"_AS{n}" for n in range(4)},
    },
    soft_horizons: {"RAMP": "_RAMP", "RAMP_SLOPE": "_RAMP_SLOPE", "APART_TINY": "_TINY", "DIAMOND_TINY": "_SHORTEST"},
    slab_float32: {"SLAB_TINY": "_TINY", "ALIKE": "_ALIKE", "GRAZING": "_GRAZING"},
    lobes: {
        "ASTRAY": "_ASTRAY", "CLEAR": "_CLEAR", "LEAST_SHARE": "_LEAST", "LOBE_SHARPNESS": "_SHARPNESS",
        "LOBE_STEEPEST": "_STEEPEST", "ALONE": "_ALONE", "LOBE_TINY": "_TINY",
    },
    importance_mixture: {"LEFT_THROUGH": "STRAIGHT_ON", "LOBE_SHORTEST": "_SHORTEST"},
    shade: {**{name: f"_{name}" for name in ("SHORTEST", "FLAKES", "GAUSS", "AWAY")}, "WHOLE_BOX": "_WHOLE"},
    wide: {"REACH": "_REACH"},
    seen_areas: {"AREA_STEPS": "_STEPS", "AREA_TURN": "_TURN"},
    view_lines: {
        "VIEW_BETWEEN": "_BETWEEN", "VIEW_COARSEST": "_COARSEST", "VIEW_LENGTH": "_LENGTH", "LINE_BOX": "_BOX",
        "FROM_ABOVE": "_FROM_ABOVE", "JUST_HALF": "_JUST",
        **{name: f"_{name}" for name in ("DEVIATIONS", "FARTHEST", "STEEP", "SMEARED")},
    },
    view_rays: {
        "VIEW_HALVINGS": "_HALVINGS", "THIRDS": "_THIRDS",
        **{n: f"_{n}" for n in ("CREST_STEPS", "CREST_CLOSE", "CREST_NEAR", "ROOT_STEPS", "CLOSE", "WHERE_IT_ENDS")},
    },
    visibility: {name: f"_{name}" for name in ("NARROWINGS", "STRIP_POINTS", "UPHILL_STEPS")},
    line_nodes: {"LINE_VERTICAL": "_VERTICAL", "LINE_GRAZING": "_GRAZING", "NEAR_END": "_NEAR_END"},
    mixture: {"LITTLE": "_LITTLE", "WIDEST": "_WIDEST"},
}  # fmt: skip


def constants() -> dict[str, float | int]:
    """Return the constants of the shader, by name; those of type int are integers there."""
    error_function = (0.3275911, 0.254829592, -0.284496736, 1.421413741, -1.453152027, 1.061405429)
    values: dict[str, object] = {
        "TEXTURE_WIDTH": TEXTURE_WIDTH,
        "PI": math.pi,
        "INVERSE_PI": 1.0 / math.pi,
        "RIGHT": 0.5 * math.pi,
        "ROOT_HALF": math.sqrt(0.5),
        "ROOT_RIGHT": math.sqrt(0.5 * math.pi),
        **{f"ERF_{n}": value for n, value in enumerate(error_function)},
        "VERTICAL_SLOPE": 1e-6,
        "ROUNDING": 2.0**-22,
        "TURNS": 1e-6,
        "GAUSS_COLUMNS": view_lines.GAUSS_PLACES.shape[1],
        "STRONGEST": mixture.COARSE_LINE.most,
        **{f"NODE_{name}": row for row, name in enumerate(("NORMAL", "TANGENT", "ALONG", "ACROSS", "HORIZONS"))},
        "FALL_ROWS": FALL_ROWS,
        **{f"CURVATURE_{n}": value for n, value in enumerate(soft_horizons.CURVATURES)},
        "LEVEL_TINY": LEVEL_TINY,
        "POINTS": POINTS,
        "LOBES": POINTS + 2,
        "WIDENING": WIDENING,
        **dict(zip(("HIDDEN_COSINE", "HIDDEN_STRAIGHT"), vars(lobes)["_HIDDEN"], strict=True)),
        **{f"LUMINANCE_{name}": share for name, share in zip(("RED", "GREEN", "BLUE"), LUMINANCE, strict=True)},
    }
    for name, (module, columns, added) in ARRAYS.items():
        values |= {column: vars(module)[column] for column in columns}
        values |= {column: len(columns) + index for index, column in enumerate(added)}
        values[f"{name}_COLUMNS"] = len(columns) + len(added)
    for module, names in _SAME:
        values |= {name: vars(module)[name] for name in names}
    for module, renamed in _RENAMED.items():
        values |= {name: vars(module)[own] for name, own in renamed.items()}
    return {name: value if isinstance(value, int) else float(np.float32(value)) for name, value in values.items()}  # type: ignore[arg-type]


def shared_constants() -> dict[str, float | int]:
    """Return the constants of the source that needs no tables: arithmetic, queries and colours."""
    values, names = constants(), ("TEXTURE_WIDTH", "TINY", "PI", "RIGHT", *_RENAMED[float32])
    return {name: values[name] for name in (*names, *(name for name in values if name.startswith("LUMINANCE")))}
