"""Drafts as weavers draw them: threading above the drawdown, treadling beside it, the tie-up in the corner between.

The first end is on the left and the first pick at the bottom; shaft 1 and treadle 1 lie next to the drawdown. A cell of
the drawdown has the colour of the thread on top, and a line on either side of that thread: so floats have outlines
whatever their colours. Colours of ends are above the threading, those of picks beside the treadling. A cell is a square
of whole pixels.
"""

from typing import Final, NamedTuple

import numpy as np

from reports.images.tiles import Bytes8, encoded, opaque, png
from weaves.draft import Bools
from weaves.fabric import Fabric

LEAST_SHOWN: Final = 16  # least ends, and picks, that are shown: smaller repeats stand several times

MOST_SHOWN: Final = 512  # most ends, and picks, that are shown: of structures up to 256 threads, all

LARGEST_CELL: Final = 24  # pixels of a side of a cell, at most

LONGEST_SIDE: Final = 1600  # pixels of a draft, at most, unless its cells would have no pixel

_LEAST_LINED = 4  # pixels of cells with lines
_PALE, _DARK = 0.2, 0.45  # weights of lines, of a grid and of floats


class _Cells(NamedTuple):
    """A rectangle of cells, the top row first."""

    colour: Bytes8  # (rows, columns, 3)
    upright: Bools  # lines on the left of each cell, and on the right of the last, (rows, columns + 1)
    level: Bools  # lines above each cell, and below the last, (rows + 1, columns)
    weight: float  # of the lines

    def drawn(self, side: int) -> Bytes8:
        """Return the cells as squares of `side` pixels and a last line, (H, W, 3)."""
        last = ((0, 1), (0, 1), (0, 0))
        pixels = np.pad(self.colour.repeat(side, axis=0).repeat(side, axis=1), last, mode="edge")
        if side >= _LEAST_LINED:
            lines = np.zeros(pixels.shape[:2], np.bool_)
            lines[:, ::side] |= np.pad(self.upright.repeat(side, axis=0), ((0, 1), (0, 0)), mode="edge")
            lines[::side] |= np.pad(self.level.repeat(side, axis=1), ((0, 0), (0, 1)), mode="edge")
            ink = np.where(pixels.max(axis=-1, keepdims=True) < 96, 160.0, 0.0)  # light lines on dark threads
            lined = (1.0 - self.weight) * pixels + self.weight * ink
            pixels = np.where(lines[..., None], np.rint(lined), pixels).astype(np.uint8)
        return pixels


def drawdown(fabric: Fabric) -> bytes:
    """Return the drawdown of the repeat of weave and colours as PNG bytes, from 16 to 512 threads in each direction."""
    cells = _drawdown(fabric)
    return png(opaque(cells.drawn(max(1, MOST_SHOWN // max(cells.colour.shape)))), 1)


def draft(fabric: Fabric) -> bytes:
    """Return the whole draft as PNG bytes; it shows as many threads as `drawdown`."""
    loom, cells = fabric.loom(), _drawdown(fabric)
    picks, ends = cells.colour.shape[:2]
    shaft_of, treadle_of = np.resize(loom.threading, ends), np.resize(loom.treadling, picks)
    tie_up = np.array(loom.tie_up, np.bool_).T[::-1]
    shafts, treadles = tie_up.shape
    warp, weft = (encoded(threads.diffuse) for threads in fabric.thread_colours())
    side = max(1, min(LARGEST_CELL, (LONGEST_SIDE - 1) // max(ends + treadles + 3, picks + shafts + 3)))
    canvas = np.full(((picks + shafts + 3) * side + 1, (ends + treadles + 3) * side + 1, 3), 255, np.uint8)
    below, beside = shafts + 3, ends + 1  # the drawdown's first row, the treadling's first column
    for row, column, part in (
        (0, 0, _grid(warp[np.arange(ends) % len(warp)][None])),
        (2, 0, _marks(np.arange(shafts, 0, -1)[:, None] == shaft_of)),
        (2, beside, _marks(tie_up)),
        (below, 0, cells),
        (below, beside, _marks(np.arange(1, treadles + 1) == treadle_of[::-1, None])),
        (below, beside + treadles + 1, _grid(weft[np.arange(picks) % len(weft)][::-1, None])),
    ):
        pixels = part.drawn(side)
        canvas[row * side :, column * side :][: len(pixels), : pixels.shape[1]] = pixels
    return png(opaque(canvas), 1)


def _drawdown(fabric: Fabric) -> _Cells:
    """Return the cells of the drawdown: lines follow the thread on top."""
    warp, weft = (encoded(threads.diffuse) for threads in fabric.thread_colours())
    ends, picks = (np.arange(min(max(extent, LEAST_SHOWN), MOST_SHOWN)) for extent in fabric.repeat)
    picks = picks[::-1]
    over = fabric.weave.warp_over[picks[:, None] % fabric.weave.repeat[1], ends % fabric.weave.repeat[0]]
    colour = np.where(over[..., None], warp[ends % len(warp)][None], weft[picks % len(weft)][:, None])
    across, along = (np.pad(side, width) for side, width in ((over, ((0, 0), (1, 1))), (~over, ((1, 1), (0, 0)))))
    return _Cells(colour, across[:, :-1] | across[:, 1:], along[:-1] | along[1:], _DARK)


def _marks(filled: Bools) -> _Cells:
    """Return cells that are black where filled, else white."""
    return _grid(np.where(filled[..., None], 0, 255).repeat(3, axis=-1).astype(np.uint8))


def _grid(colour: Bytes8) -> _Cells:
    """Return cells with all lines between them."""
    rows, columns = colour.shape[:2]
    return _Cells(colour, np.ones((rows, columns + 1), np.bool_), np.ones((rows + 1, columns), np.bool_), _PALE)
