"""Places of labels beside their marks: no label covers another label, a mark or the border of its panel.

Every label tries the same places, nearest first, and takes the first distance at which one is free; of the free places
there it takes that which covers the least of the curves. A label away from its mark is joined to it by a thin line,
which crosses a label only where every other place is taken. Equal figures give equal places.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.text import Annotation, Text
from matplotlib.transforms import Bbox

from reports.page.colours import Scheme

DISTANCES: Final = (7.0, 13.0, 20.0, 28.0, 38.0, 50.0, 64.0, 80.0, 100.0)
"""From the middle of a mark to the nearest edge of its label, in points."""
NEAR: Final = 13.0
"""Largest distance without a line."""
DIRECTIONS: Final = 48
FIRST: Final = 225.0
"""Direction of the first place, in degrees: below, on the left."""
CLEARANCE: Final = 1.5
"""Least distance of a label from others, in points."""
MARK: Final = 5.0
"""Half a mark, edge included, in points."""

Points = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Label:
    """A text that belongs to a mark."""

    axes: Axes
    text: str
    x: float
    """Of the mark, in data coordinates."""
    y: float
    colour: str


def place_labels(figure: Figure, labels: Sequence[Label], scheme: Scheme, size: float = 8.0) -> list[Annotation]:
    """Write labels into a figure whose curves and legend are complete, and return them.

    Parameters
    ----------
    figure : Figure
        Its lines are curves with a mark at every point.
    labels : sequence of Label
        Those that come first choose first. One that finds no free place at all takes the place that covers the least.
    size : float
        Of the text, in points.
    """
    figure.draw_without_rendering()  # the layout moves the axes
    make: Any = RendererAgg  # has no types
    renderer, pixels = make(*figure.bbox.size, figure.dpi), figure.dpi / 72.0
    panels: dict[Axes, _Taken] = {}
    written = []
    for label in labels:
        axes = label.axes
        taken = panels.setdefault(axes, _Taken(_marks(axes, MARK * pixels), [], _curves(axes), []))
        halo = [withStroke(linewidth=2.5, foreground=scheme.ground)]
        text = axes.annotate(
            label.text, (label.x, label.y), xytext=(0, 0), textcoords="offset points", ha="center", va="center",
            fontsize=size, color=label.colour, zorder=6, path_effects=halo,
            arrowprops={"arrowstyle": "-", "color": label.colour, "linewidth": 0.7, "shrinkA": 0, "shrinkB": 4},
        )  # fmt: skip
        text.set_in_layout(False)
        assert text.arrow_patch is not None
        text.arrow_patch.set_in_layout(False)
        extent = Text.get_window_extent(text, renderer)  # of the letters alone
        mark = np.asarray(axes.transData.transform((label.x, label.y)), np.float64)
        place = _free_place(mark, extent, taken, axes.bbox, pixels)
        text.set_position((place.offset[0] / pixels, place.offset[1] / pixels))
        text.arrow_patch.set_visible(place.distance > NEAR)
        taken.labels.append(place.box)
        taken.lines.append(place.line)
        written.append(text)
    return written


@dataclass
class _Taken:
    """Parts of a panel that are in use, in pixels."""

    marks: list[Bbox]
    labels: list[Bbox]
    curves: Points
    """Points along curves, (N, 2)."""
    lines: list[Points]
    """Points along lines to labels."""


class _Place(NamedTuple):
    """A place of a label."""

    offset: tuple[float, float]
    """From the mark to the middle of the label, in pixels."""
    distance: float
    """One of `DISTANCES`."""
    box: Bbox
    line: Points
    """Points along the line to the mark, (N, 2); none if it is near."""


def _free_place(mark: Points, extent: Bbox, taken: _Taken, inside: Bbox, pixels: float) -> _Place:
    """Return the place of least cost at the nearest distance that has a free one."""
    width, height = extent.width + 2 * CLEARANCE * pixels, extent.height + 2 * CLEARANCE * pixels
    costs: dict[tuple[float, int, int, float, int], _Place] = {}
    for distance in DISTANCES:
        for turn in range(DIRECTIONS):
            # Turns alternate left and right of the first direction.
            angle = math.radians(FIRST + (-1) ** turn * -(-turn // 2) * 360.0 / DIRECTIONS)
            right, up = math.cos(angle), math.sin(angle)
            offset = (right * (distance * pixels + 0.5 * width), up * (distance * pixels + 0.5 * height))
            middle = mark + offset
            box = Bbox.from_bounds(middle[0] - 0.5 * width, middle[1] - 0.5 * height, width, height)
            line = np.empty((0, 2)) if distance <= NEAR else _between(mark, middle)
            line = line[~_within(line, box)]
            used = [*taken.marks, *taken.labels]
            covered = sum(_overlap(box, other) for other in used) + width * height - _overlap(box, inside)
            through = sum(int(_within(line, other).any()) for other in taken.labels)
            through += sum(int(_within(other, box).any()) for other in taken.lines)
            cost = (round(covered, 3), through, int(_within(taken.curves, box).sum()), distance, turn)
            costs[cost] = _Place(offset, distance, box, line)
        if min(costs)[:2] == (0.0, 0):
            break
    return costs[min(costs)]


def _within(points: Points, box: Bbox) -> npt.NDArray[np.bool_]:
    """Return which points (N, 2) lie in a box."""
    x, y = points.T
    return np.asarray((x > box.x0) & (x < box.x1) & (y > box.y0) & (y < box.y1))


def _between(start: Points, end: Points) -> Points:
    """Return points a pixel apart on the way from one point to another, (N, 2)."""
    steps = np.linspace(0.0, 1.0, max(int(np.hypot(*(end - start))), 1))
    return np.asarray(start + steps[:, None] * (end - start))


def _overlap(first: Bbox, second: Bbox) -> float:
    """Return the area that two boxes share."""
    width = min(first.x1, second.x1) - max(first.x0, second.x0)
    height = min(first.y1, second.y1) - max(first.y0, second.y0)
    return float(max(width, 0.0) * max(height, 0.0))


def _marks(axes: Axes, half: float) -> list[Bbox]:
    """Return the boxes of all marks of curves and of scattered points."""
    curves = [np.asarray(line.get_xydata(), np.float64) for line in axes.lines if line.get_marker() != "None"]
    points = np.concatenate([np.empty((0, 2)), *curves, *(np.asarray(c.get_offsets()) for c in axes.collections)])
    return [Bbox.from_bounds(x - half, y - half, 2 * half, 2 * half) for x, y in axes.transData.transform(points)]


def _curves(axes: Axes) -> Points:
    """Return points a pixel apart along all curves, (N, 2)."""
    found = [np.empty((0, 2))]
    for line in axes.lines:
        shown = np.asarray(axes.transData.transform(np.asarray(line.get_xydata(), np.float64)))
        for start, end in itertools.pairwise(shown):
            found.append(_between(start, end))
    return np.concatenate(found)
