"""One side of a cloth as lobes need it: pieces, coarse grids of horizons, yarns and luminances of their colours."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.analytic.soft_nodes.nodes import EVEN, tabulate_pieces
from pipeline.compiled.arrays import Float32, Index
from pipeline.truth.cloth import cloth_side
from pipeline.truth.geometry.pieces import longest_period
from pipeline.truth.options import TruthOptions
from weaves.colour import luminance
from weaves.fabric import Fabric

SPECULAR, DIFFUSE, THROUGH = range(3)
"""Rows of `LobeSurface.luminance`: k_s, k_d and k_dt."""

_GRID = 12  # cells along each axis: some tens of kilobytes, which stay in the cache


class LobeSurface(NamedTuple):
    """One side of a cloth."""

    repeat: Index
    """Ends and picks, (2,)."""
    yarn: Float32
    """`HeightField.yarn`, (2, 8)."""
    thickness: np.float32
    """Optical thickness T."""
    uniform: float
    """Deviation from which on a Gaussian covers the cloth evenly."""
    piece_starts: Index
    pieces: Index
    bounds: Float32
    grid: npt.NDArray[np.uint8]
    """As in `pipeline.analytic.soft_nodes.nodes.SoftNodeTable`, the grid flat."""
    size: int
    """Cells of a grid along each axis."""
    luminance: Float32
    """Luminances of the mean colours of warp and weft: SPECULAR, DIFFUSE, THROUGH, (3, 2)."""


def tabulate_surface(fabric: Fabric) -> LobeSurface:
    """Return the front of a fabric, as the default model of the truth sees it."""
    model = cloth_side(fabric, TruthOptions())
    front, found = model.front, tabulate_pieces(model, _GRID)
    picks, ends = front.top.shape
    average = fabric.average()
    colours: Final = ("specular_rgb", "diffuse_rgb", "diffuse_transmission_rgb")
    return LobeSurface(
        repeat=np.array([ends, picks], np.int64),
        yarn=np.ascontiguousarray(front.yarn, np.float32),
        thickness=np.float32(front.thickness),
        uniform=EVEN * longest_period(front),
        piece_starts=found["piece_starts"],
        pieces=found["pieces"],
        bounds=found["bounds"],
        grid=found["grid"].ravel(),
        size=_GRID,
        luminance=np.array(
            [[luminance(getattr(yarn, name)) for yarn in (average.warp, average.weft)] for name in colours], np.float32
        ),
    )
