"""The surface at the nodes of a kind: normal, tangent, and by how much the tangent turns within a node's box.

A highlight may be narrower than a box. The tangent's change over half a box, along and across the yarn, gives it four
places there, at the points of the Gauss rule (1 / sqrt 3 of half a box). Everything is in the frame of the yarn.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from pipeline.analytic.gauss_rules import Double, Rule
from pipeline.truth.geometry.heightfield import BETA, COS_TWIST, GAP, SIN_TWIST, WARP
from pipeline.truth.geometry.pieces import Piece

ROWS: Final = 13
"""Normal (3), 1 / n_z, tangent (3), its change along (3) and across (3)."""

LEVEL: Final = np.array([0.0, 0.0, 1.0, 1.0] + [0.0] * 9)
"""The rows of a gap, and of what fills a block of lanes."""

STEEPEST: Final = 0.999
"""Largest sine of an inclination."""


def piece_rows(yarn: npt.NDArray[np.float64], piece: Piece, across: Rule, along: Rule) -> Double:
    """Return what nodes know of the surface, (ROWS, nodes); nodes across the yarn follow each other.

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
    radius, sin_t, cos_t, beta = piece.radius, own[SIN_TWIST], own[COS_TWIST], own[BETA]
    turned = 1.0 if piece.family == WARP else -1.0  # y of the yarn's frame against the cell's axis

    # Sines and cosines of the angles across (v) and along (u).
    sv = np.clip((np.tile(across.places, lines) - 0.5) / radius, -1.0, 1.0)
    cv = np.sqrt((1.0 - sv) * (1.0 + sv))
    place = turned * (np.repeat(along.places, columns) - 0.5 + piece.offset)
    curve = piece.sign * piece.curve / (1.0 + piece.sign * radius * piece.curve * cv)
    bound = min(piece.steepest, STEEPEST)
    su = np.clip(place * curve, -bound, bound)
    cu = np.sqrt((1.0 - su) * (1.0 + su))

    normal = np.stack([beta * sv, beta * su * cv, cu * cv])
    normal /= np.linalg.norm(normal, axis=0)
    tangent = np.stack([-cv * sin_t, cu * cos_t + su * sv * sin_t, beta * (cu * sv * sin_t - su * cos_t)])
    size = np.linalg.norm(tangent, axis=0)
    tangent /= size

    # Derivatives of the tangent by u and v, without what only stretches it, over half a box.
    by_u = np.stack([np.zeros_like(su), cu * sv * sin_t - su * cos_t, -beta * (cu * cos_t + su * sv * sin_t)]) / size
    by_v = np.stack([sv * sin_t, su * cv * sin_t, beta * cu * cv * sin_t]) / size
    step_u = 0.5 * np.repeat(np.diff(along.borders), columns) * curve / cu
    step_v = 0.5 * np.tile(np.diff(across.borders), lines) / (radius * np.maximum(cv, 1e-9))
    changes = []
    for derivative, step in ((by_u, step_u), (by_v, step_v)):
        turning = derivative - tangent * (tangent * derivative).sum(axis=0)
        changes.append(turning * (step / math.sqrt(3.0)))
    return np.concatenate([normal, 1.0 / normal[2:3], tangent, *changes])
