"""Tensor trees: BSDF files of Radiance with directions on the square of Shirley and Chiu, in cells of several sizes.

The square keeps areas: a cell is a share of the disc of labels, and so of projected solid angle. A block of a file is a
grid of values, or branches into halves along each axis: x and y of the light's label, then x and y of what is
scattered. In a grid the last axis is fastest, among branches the first one. A file of rank 3 is of a layer without
axes: its first axis is .5 - .5 sine of the light, whose label is turned to azimuth 0.
"""

from __future__ import annotations

import math
import re
from typing import Any, Final

import numpy as np

from pipeline.bsdf.klems import KLEMS_FULL, Basis
from pipeline.compiled.arrays import Float64, Index
from weaves.errors import BadInput, one_line

SHIRLEY_CHIU: Final = "LBNL/Shirley-Chiu"
RANKS: Final = {"TensorTree3": 3, "TensorTree4": 4}  # number of axes by the form that a file states

_LOBE_LEVELS: Final = 2  # by which cells of light that goes straight through are finer
_FINEST: Final = 5  # level to which a file is averaged
_POINTS: Final = 16  # along each side of a cell, for its share of each Klems patch
_DEEPEST: Final = 16  # levels of branches that a file may have


class Square(Basis):
    """Cells of one size: a basis of one ring."""

    @classmethod
    def of(cls, level: int) -> Square:
        """Return the basis of 4^level cells."""
        return cls(SHIRLEY_CHIU, (0, 90), (4**level,))

    @property
    def side(self) -> int:
        """Number of cells along each axis."""
        return math.isqrt(self.patches)

    @property
    def opposite(self) -> Index:
        """Cell of the label (-x, -y) of each cell, (P,)."""
        return np.arange(self.patches)[::-1]

    @property
    def mirror(self) -> Index:
        """Cell of the label (-x, y) of each cell, (P,)."""
        return np.arange(self.patches).reshape(self.side, -1)[::-1].ravel()

    @property
    def normal(self) -> int:
        """One of the four cells beside the normal."""
        return self.side // 2 * (self.side + 1)

    @property
    def of_lobes(self) -> Square:
        """Cells of a quarter of the side."""
        return Square(self.name, self.bounds, (self.patches * 4**_LOBE_LEVELS,))

    def means(self, shares: Float64) -> Float64:
        """Return means over cells of numbers in `of_lobes`, (P,)."""
        parts = shares.reshape(self.side, 2**_LOBE_LEVELS, self.side, 2**_LOBE_LEVELS)
        return np.asarray(parts.mean(axis=(1, 3)).ravel())

    def directions(self, patch: Index, u: Float64, v: Float64) -> Float64:
        """Return labels (N, 3), z >= 0, of N points of cells: u and v in [0, 1) along the axes of the square."""
        a, b = 2.0 * (patch // self.side + u) / self.side - 1.0, 2.0 * (patch % self.side + v) / self.side - 1.0
        along = np.abs(a) > np.abs(b)
        radius, across = np.where(along, a, b), np.where(along, b, a)
        turn = 0.25 * np.pi * across / np.where(radius == 0.0, 1.0, radius)
        near, far = radius * np.cos(turn), radius * np.sin(turn)
        z = np.sqrt(np.maximum(1.0 - radius * radius, 0.0))
        return np.stack([np.where(along, near, far), np.where(along, far, near), z], axis=-1)

    def cells(self, radius: Float64, azimuth: Float64) -> Index:
        """Return the cells of labels, (N,)."""
        quarter = np.round(azimuth / (0.5 * np.pi))
        across = radius * (azimuth / (0.25 * np.pi) - 2.0 * quarter)
        cosine, sine = (np.round(f(0.5 * np.pi * quarter)) for f in (np.cos, np.sin))
        place = np.stack([cosine * radius - sine * across, sine * radius + cosine * across])
        x, y = np.clip((0.5 * (place + 1.0) * self.side).astype(np.int64), 0, self.side - 1)
        return np.asarray(x * self.side + y)


def tree_text(values: Float64, square: Square, straight: Float64 | None = None) -> str:
    """Return a block as text: values [scattered to, light] in 1/sr.

    `straight` is the share of light that goes straight through in each cell of `square.of_lobes`. The values have its
    lobe, a mean over their cells; in the text it lies in the small cells alone.
    """
    side = square.side
    if straight is None:
        return _leaf(values.T)
    fine = square.of_lobes
    lobe = (straight / fine.projected_solid_angle).reshape(fine.side, fine.side)
    rest = values.T - np.diag(square.means(straight) / square.projected_solid_angle)
    grid, cells = np.maximum(rest, 0.0).reshape((side,) * 4), fine.side // side

    def node(light: tuple[int, int], out: tuple[int, int], size: int) -> str:
        """Return the text of two squares of `size` small cells a side, which begin at these."""
        if light == out and size > 1:
            corners = [(x * size // 2, y * size // 2) for y in (0, 1) for x in (0, 1)]
            branches = (
                node((light[0] + a, light[1] + b), (out[0] + c, out[1] + d), size // 2)
                for c, d in corners
                for a, b in corners
            )
            return "{" + "\n".join(branches) + "}"
        ranges = (slice(start // cells, (start + size - 1) // cells + 1) for start in (*light, *out))
        return _leaf(grid[tuple(ranges)] + (lobe[light] if light == out else 0.0))

    return node((0, 0), (0, 0), fine.side)


def _leaf(values: Float64) -> str:
    return "{" + " ".join(f"{value:.5g}" for value in values.ravel()) + "}"


def read_tree(where: str, text: str, rank: int) -> Float64:
    """Read a block as the means over pairs of patches of Klems's full basis, [scattered to, light], 1/sr."""
    level = _FINEST if rank == 4 else _FINEST + 1
    dense = _dense(where, _parsed(where, text), rank, level)
    square = Square.of(_FINEST)
    if rank == 3:
        label = square.directions(np.arange(square.patches), *np.full((2, square.patches), 0.5))
        sine, azimuth = np.hypot(label[:, 0], label[:, 1]), np.arctan2(label[:, 1], label[:, 0])
        fine = Square.of(level)
        turned = fine.cells(sine[None, :], azimuth[None, :] - azimuth[:, None])
        into = ((0.5 - 0.5 * sine) * fine.side).astype(np.int64)
        dense = dense.reshape(fine.side, -1)[into[:, None], turned]
    share = _shares(square)
    return np.asarray(share @ dense.reshape(square.patches, -1).T @ share.T)


def _shares(square: Square) -> Float64:
    """Return how much of each Klems patch lies in each cell, (145, P); the cells of a patch have 1 together."""
    step = (np.arange(_POINTS) + 0.5) / _POINTS
    u, v = (np.tile(axis.ravel(), square.patches) for axis in np.meshgrid(step, step))
    cell = np.repeat(np.arange(square.patches), _POINTS**2)
    x, y, z = square.directions(cell, u, v).T
    bounds, counts = np.array(KLEMS_FULL.bounds), np.array(KLEMS_FULL.counts)
    ring = np.searchsorted(bounds[1:-1], np.degrees(np.arccos(z)), side="right")
    number = np.round(np.arctan2(y, x) / (2.0 * np.pi) * counts[ring]).astype(np.int64) % counts[ring]
    pair = ((np.cumsum(counts) - counts)[ring] + number) * square.patches + cell
    share = np.bincount(pair, minlength=KLEMS_FULL.patches * square.patches).reshape(KLEMS_FULL.patches, -1)
    return np.asarray(share / share.sum(axis=1, keepdims=True))


def _parsed(where: str, text: str) -> list[Any]:
    """Return a tree as lists in lists."""
    stack: list[list[Any]] = [[]]
    for token in re.findall(r"[{}]|[^\s,{}]+", text):
        if token == "{" and len(stack) <= _DEEPEST:
            stack.append([])
        elif token == "}" and len(stack) > 1:
            node = stack.pop()
            stack[-1].append(node)
        else:
            try:
                stack[-1].append(float(token))
            except ValueError as error:
                raise BadInput(where, "ScatteringData", one_line(error, 60), "numbers are needed") from error
    if len(stack) != 1 or len(stack[0]) != 1 or not isinstance(stack[0][0], list):
        raise BadInput(where, "ScatteringData", "braces without a match", "one tree in braces is needed")
    return stack[0][0]


def _dense(where: str, node: list[Any], rank: int, level: int) -> Float64:
    """Return a tree as a grid of 2^level cells along each axis: finer ones are averaged, coarser ones repeated."""
    side = 2**level
    if all(isinstance(part, float) for part in node):
        own = round(len(node) ** (1.0 / rank)) if node else 0
        if not node or own**rank != len(node) or own & (own - 1):
            raise BadInput(where, "values of a grid", len(node), f"a power of {2**rank} is needed")
        if not np.isfinite(node).all():
            raise BadInput(where, "ScatteringData", "not a finite number", "finite numbers are needed")
        grid = np.array(node).reshape((own,) * rank)
        for axis in range(rank):
            grid = np.repeat(grid, max(side // own, 1), axis)
        return np.asarray(grid.reshape((side, len(grid) // side) * rank).mean(axis=tuple(range(1, 2 * rank, 2))))
    if len(node) != 2**rank or not all(isinstance(part, list) for part in node):
        raise BadInput(where, "branches of a tree", len(node), f"{2**rank} branches or values alone are needed")
    parts = [_dense(where, part, rank, max(level - 1, 0)) for part in node]
    if level == 0:
        return np.asarray(np.mean(parts, axis=0))
    grid = np.empty((side,) * rank)
    for number, part in enumerate(parts):
        half = (slice((number >> axis & 1) * side // 2, ((number >> axis & 1) + 1) * side // 2) for axis in range(rank))
        grid[tuple(half)] = part
    return grid
