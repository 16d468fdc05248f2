"""Places of labels beside their marks: no label covers another label, a mark or the border of its panel.

Every label tries the same places, nearest first, and takes the first distance at which one is free; of the free places
there it takes that which covers the least of the curves. A label away from its mark is joined to it by a thin line.
Equal figures give equal places.
"""

import itertools
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.text import Annotation, Text

from pipeline.compiled.arrays import Float64
from reports.page.colours import Scheme

# All in points but the angle.
DISTANCES: Final = (7.0, 13.0, 20.0, 28.0, 38.0, 50.0, 64.0, 80.0, 100.0)  # of a mark's middle from its label's edge
UNJOINED: Final = 13.0  # largest distance without a line
CLEARANCE: Final = 1.5  # least distance of a label from others
MARK: Final = 5.0  # half a mark, edge included
_DIRECTIONS: Final = 48
_FIRST: Final = 225.0  # direction of the first place, in degrees: below, on the left


class Label(NamedTuple):
    """A text that belongs to a mark."""

    axes: Axes
    text: str
    x: float  # of the mark, in data coordinates
    y: float
    colour: str


def place_labels(figure: Figure, labels: Sequence[Label], scheme: Scheme) -> list[Annotation]:
    """Write labels into a figure whose curves and legend are complete, and return them.

    The figure's lines are curves with a mark at every point. Labels that come first choose first; one that finds no
    free place at all takes the place that covers the least.
    """
    figure.draw_without_rendering()  # the layout moves the axes
    make: Any = RendererAgg  # has no types
    renderer, pixels = make(*figure.bbox.size, figure.dpi), figure.dpi / 72.0
    used: dict[Axes, list[Float64]] = {}
    written = []
    for label in labels:
        axes = label.axes
        halo = [withStroke(linewidth=2.5, foreground=scheme.ground)]
        text = axes.annotate(
            label.text, (label.x, label.y), xytext=(0, 0), textcoords="offset points", ha="center", va="center",
            fontsize=8, color=label.colour, zorder=6, path_effects=halo,
            arrowprops={"arrowstyle": "-", "color": label.colour, "linewidth": 0.7, "shrinkA": 0, "shrinkB": 4},
        )  # fmt: skip
        text.set_in_layout(False)
        assert text.arrow_patch is not None
        text.arrow_patch.set_in_layout(False)
        extent = Text.get_window_extent(text, renderer)  # of the letters alone
        mark = np.asarray(axes.transData.transform((label.x, label.y)), np.float64)
        half = 0.5 * np.array([extent.width, extent.height]) + CLEARANCE * pixels
        taken = used.setdefault(axes, _marks(axes, MARK * pixels))
        panel = np.array([*axes.bbox.p0, *axes.bbox.p1])
        offset, distance = _free_place(mark, half, np.array(taken), panel, _curves(axes), pixels)
        text.set_position((offset[0] / pixels, offset[1] / pixels))
        text.arrow_patch.set_visible(distance > UNJOINED)
        taken.append(np.concatenate([mark + offset - half, mark + offset + half]))
        written.append(text)
    figure.set_layout_engine("none")  # labels are not in the layout: `savefig` would find the same one again
    return written


def _free_place(
    mark: Float64, half: Float64, taken: Float64, panel: Float64, curves: Float64, pixels: float
) -> tuple[Float64, float]:
    """Return the place of least cost at the nearest distance that has a free one: its offset, and the distance.

    Of the `mark` (2,) and `half` the size of the label (2,). Boxes have left, bottom, right and top: those `taken`
    (N, 4), and the `panel` (4,) that the label may not leave. `curves` (M, 2) are points along curves.
    """
    # Turns alternate left and right of the first direction.
    turns = np.array([(-1) ** turn * -(-turn // 2) for turn in range(_DIRECTIONS)])
    angles = np.radians(_FIRST + turns * 360.0 / _DIRECTIONS)
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    places = []
    for distance in DISTANCES:
        offsets = directions * (distance * pixels + half)
        boxes = np.concatenate([mark + offsets - half, mark + offsets + half], axis=-1)
        outside = 4.0 * half.prod() - _overlaps(boxes, panel[None])
        covered = np.round(_overlaps(boxes, taken) + outside, 3)
        lower, upper = boxes[:, None, :2], boxes[:, None, 2:]
        through = ((curves > lower) & (curves < upper)).all(axis=-1).sum(axis=-1)
        best = int(np.lexsort((through, covered))[0])
        places.append((covered[best], through[best], distance, offsets[best]))
        if covered[best] == 0.0:
            break
    *_, distance, offset = min(places, key=lambda place: place[:3])
    return offset, distance


def _overlaps(boxes: Float64, others: Float64) -> Float64:
    """Return the area that each box (N, 4) shares with other boxes (M, 4), summed over these: (N,)."""
    lower = np.maximum(boxes[:, None, :2], others[:, :2])
    upper = np.minimum(boxes[:, None, 2:], others[:, 2:])
    return np.asarray(np.maximum(upper - lower, 0.0).prod(axis=-1).sum(axis=-1))


def _marks(axes: Axes, half: float) -> list[Float64]:
    """Return the boxes of all marks of curves and of scattered points."""
    curves = [np.asarray(line.get_xydata(), np.float64) for line in axes.lines if line.get_marker() != "None"]
    points = np.concatenate([np.empty((0, 2)), *curves, *(np.asarray(c.get_offsets()) for c in axes.collections)])
    return [np.concatenate([place - half, place + half]) for place in axes.transData.transform(points)]


def _curves(axes: Axes) -> Float64:
    """Return points a pixel apart along all curves, (N, 2)."""
    points = [np.empty((0, 2))]
    for line in axes.lines:
        shown = np.asarray(axes.transData.transform(np.asarray(line.get_xydata(), np.float64)))
        for start, end in itertools.pairwise(shown):
            steps = np.linspace(0.0, 1.0, max(int(np.hypot(*(end - start))), 1))
            points.append(start + steps[:, None] * (end - start))
    return np.concatenate(points)
