"""The surface at the nodes of a group: normal, tangent, and by how much the tangent turns within a node's box.

A highlight may be narrower than a box. The tangent's change over half a box, along and across the yarn, gives it four
places there, at the points of the Gauss rule (1 / sqrt 3 of half a box). Everything is in the frame of the yarn.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pipeline.analytic.gauss_rules import Rule
from pipeline.analytic.torus_frame import Fibre, bend, normal, tangent, turning
from pipeline.compiled.arrays import Float64
from pipeline.compiled.decorators import fast_kernel
from pipeline.truth.geometry.heightfield import BETA, COS_TWIST, GAP, SIN_TWIST, WARP
from pipeline.truth.geometry.pieces import Piece

ROWS: Final = 13
"""Normal (3), 1 / n_z, tangent (3), its change along (3) and across (3)."""

LEVEL: Final = np.array([0.0, 0.0, 1.0, 1.0] + [0.0] * 9)
"""The rows of a gap, and of the nodes that fill up a block."""

_AXES = np.eye(3)
_GAUSS = 1.0 / math.sqrt(3.0)

STEEPEST: Final = 0.999
"""Largest sine of an inclination."""


def piece_rows(yarn: Float64, piece: Piece, across: Rule, along: Rule) -> Float64:
    """Return the surface at nodes, (ROWS, nodes); nodes across the yarn follow each other.

    Parameters
    ----------
    yarn : float64 (families, 8)
        `HeightField.yarn`.
    piece : Piece
        The piece, of a yarn or of a gap.
    across, along : Rule
        Its nodes.
    """
    lines, columns = len(along.places), len(across.places)
    if piece.family == GAP:
        return np.tile(LEVEL[:, None], lines * columns)
    own = yarn[piece.family]
    radius = piece.radius
    turned = 1.0 if piece.family == WARP else -1.0  # y of the yarn's frame against the cell's axis

    # Sine of the angle across, place along and half box of each node.
    sines = np.clip((np.tile(across.places, lines) - 0.5) / radius, -1.0, 1.0)
    places = turned * (np.repeat(along.places, columns) - 0.5 + piece.offset)
    half_across = 0.5 * np.tile(np.diff(across.borders), lines)
    half_along = 0.5 * np.repeat(np.diff(along.borders), columns)
    bound = min(piece.steepest, STEEPEST)
    fibre = Fibre(float(own[SIN_TWIST]), float(own[COS_TWIST]), float(own[BETA]))
    found = np.zeros((ROWS, len(sines)))
    _fill_rows(
        sines,
        places,
        half_across,
        half_along,
        float(radius),
        float(piece.sign * piece.curve),
        float(bound),
        fibre,
        found,
    )
    return found


@fast_kernel
def _fill_rows(
    sines: Float64,
    places: Float64,
    half_across: Float64,
    half_along: Float64,
    radius: float,
    curvature: float,
    limit: float,
    fibre: Fibre,
    found: Float64,
) -> None:
    """Write the rows of all nodes of a piece of yarn, (ROWS, nodes)."""
    for k in range(len(sines)):
        cos_v = math.sqrt((1.0 - sines[k]) * (1.0 + sines[k]))
        angles, inner = bend(sines[k], cos_v, radius, places[k], curvature, limit)
        found[0, k], found[1, k], found[2, k] = normal(angles, fibre.beta)
        found[3, k] = 1.0 / found[2, k]
        t = tangent(angles, fibre)
        found[4, k], found[5, k], found[6, k] = t.x, t.y, t.z
        step_u = _GAUSS * half_along[k] * inner / angles.cos_u
        step_v = _GAUSS * half_across[k] / (radius * max(cos_v, 1e-9))
        for axis in range(3):
            by_u, by_v = turning(_AXES[axis, 0], _AXES[axis, 1], _AXES[axis, 2], t, angles, fibre)
            found[7 + axis, k], found[10 + axis, k] = step_u * by_u, step_v * by_v
