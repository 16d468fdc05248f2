"""The surface of a woven repeat as triangles: two meshes of yarn and one of the walls between them.

Every cell of the draft is cut into rectangles in which one piece of yarn is seen: the yarn on top, and where that is
too narrow the strips of the one beneath. A rectangle is a grid of vertices, x = r sin v across its yarn with equal
steps of v, in equal steps along it, at the heights that `weaves.surface` gives. Where rectangles meet at different
heights a vertical wall closes the step. At the rim of a gap the wall goes down to the lowest point of the cloth: light
that passes it leaves, as it does where the height field has no floor.
"""

from collections.abc import Sequence
from typing import Final, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from weaves.draft import Floats
from weaves.fabric import Fabric
from weaves.surface import WARP, WEFT, surface_at

INSIDE: Final = 1e-12  # distance inside a piece at which its border is sampled, so that it is on top there
LEAST_STEP: Final = 1e-6  # pieces whose heights differ by less than this meet without a wall, in yarn spacings


class Mesh(NamedTuple):
    """Triangles: vertices, (V, 3), in yarn spacings, and corners, (F, 3).

    x runs along the weft, y along the warp, z up. Corners are counterclockwise as seen from the open side: from above,
    or from the lower side of a wall.
    """

    vertices: Floats
    faces: npt.NDArray[np.int64]


class RepeatMesh(NamedTuple):
    """Meshes of a cloth; together they have one point above every point of the plane, none in gaps."""

    warp: Mesh  # parts of the yarn that are visible from above
    weft: Mesh
    walls: Mesh
    """The steps between them; those at x = 0 and y = 0 are in it, those at the far borders are of the next repeat."""


class _Piece(NamedTuple):
    """One rectangle in several cells: places of its vertices from the cell's corner, heights (n, y, x)."""

    family: int
    pick: npt.NDArray[np.intp]
    end: npt.NDArray[np.intp]
    x: Floats
    y: Floats
    z: Floats


def repeat_mesh(fabric: Fabric, vertices_per_cell: int = 64, repeats: tuple[int, int] = (1, 1)) -> RepeatMesh:
    """Cover a cloth with triangles; vertices are shared within a piece, not between pieces.

    A yarn has `vertices_per_cell` steps across it, and along it in every cell, >= 2: the error of heights between
    vertices falls as its inverse square. There are `repeats` copies along x and along y, >= 1.
    """
    pieces = _pieces(fabric, vertices_per_cell)
    floor = min(float(piece.z.min()) for piece in pieces)
    cells = fabric.weave.warp_over.shape
    turned = [_Piece(p.family, p.end, p.pick, p.y, p.x, p.z.transpose(0, 2, 1)) for p in pieces]
    walls = [_walls(pieces, cells, floor), _walls(turned, cells[::-1], floor)]
    # The second walls were found in the turned cloth, x and y swapped, which also turns every triangle over.
    walls[1] = Mesh(walls[1].vertices[:, [1, 0, 2]], walls[1].faces[:, ::-1])
    yarns = (joined([_grids(piece) for piece in pieces if piece.family == family]) for family in (WARP, WEFT))
    copies = np.array([(i * cells[1], j * cells[0], 0.0) for j in range(repeats[1]) for i in range(repeats[0])])
    meshes = (*yarns, joined(walls))
    return RepeatMesh(*(joined([Mesh(mesh.vertices + at, mesh.faces) for at in copies]) for mesh in meshes))


def _pieces(fabric: Fabric, steps: int) -> list[_Piece]:
    """Cut the cells into rectangles and compute their vertices."""
    sine = np.sin(np.linspace(-np.pi / 2, np.pi / 2, steps + 1))
    along = np.linspace(0.0, 1.0, steps + 1)
    radius = (fabric.warp.width / 2, fabric.weft.width / 2)
    # A yarn as good as full leaves no strip.
    margin = [0.0 if r > 0.5 - 1e-9 else 0.5 - r for r in radius]
    across = [_ending(0.5 + r * sine, m, 1.0 - m) for r, m in zip(radius, margin, strict=True)]
    look_across = [0.5 + (r - INSIDE) * sine for r in radius]
    pieces = []
    for top, beneath in ((WARP, WEFT), (WEFT, WARP)):
        pick, end = np.nonzero(fabric.weave.warp_over == (top == WARP))
        m = margin[top]
        strip = np.linspace(0.0, m, max(1, int(np.ceil(steps * m))) + 1)
        seen = [(top, along), (beneath, strip), (beneath, _ending(1.0 - strip[::-1], 1.0 - m, 1.0))]
        for family, place in seen if m > 0 else seen[:1]:
            look = np.clip(place, place[0] + INSIDE, place[-1] - INSIDE)
            x, y = (across[family], place) if family == WARP else (place, across[family])
            look_x, look_y = (look_across[family], look) if family == WARP else (look, look_across[family])
            z = surface_at(fabric, end[:, None, None] + look_x, pick[:, None, None] + look_y[:, None]).height
            if len(pick):
                pieces.append(_Piece(family, pick, end, x, y, z))
    return pieces


def _ending(places: Floats, first: float, last: float) -> Floats:
    """Return the places with exact ends, by which neighbours are known."""
    return np.concatenate([[first], places[1:-1], [last]])


def _grids(piece: _Piece) -> Mesh:
    count, rows, columns = piece.z.shape
    x, y = (piece.end[:, None, None] + piece.x, piece.pick[:, None, None] + piece.y[:, None])
    vertices = np.stack(np.broadcast_arrays(x, y, piece.z), axis=-1).reshape(-1, 3)
    corner = np.arange(count * rows * columns).reshape(count, rows, columns)
    a, b, c, d = corner[:, :-1, :-1], corner[:, :-1, 1:], corner[:, 1:, 1:], corner[:, 1:, :-1]
    return Mesh(vertices, np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3))


def _walls(pieces: Sequence[_Piece], cells: tuple[int, ...], floor: float) -> Mesh:
    """Close the steps across x: at the borders of the cells, and inside them where a yarn ends."""
    # Both sides are straight between the vertices of either, so that walls fit the pieces exactly.
    grid = np.unique(np.round(np.concatenate([piece.y for piece in pieces]), 12))
    walls = []
    for border in sorted({float(place) for piece in pieces for place in piece.x[[0, -1]]} - {1.0}):
        left, right = (np.full((*cells, len(grid) - 1, 2), floor) for _ in range(2))
        for piece in pieces:
            if piece.x[-1] == (border or 1.0):
                _lay(left, grid, piece, -1)
            if piece.x[0] == border:
                _lay(right, grid, piece, 0)
            if piece.x[0] < border < piece.x[-1]:
                _lay(left, grid, piece, None)
                _lay(right, grid, piece, None)
        # What is left of a cell's first border lies in the cell before it.
        walls.append(_steps(border, grid, left if border else np.roll(left, 1, axis=1), right))
    return joined(walls)


def _lay(profile: Floats, grid: Floats, piece: _Piece, column: Literal[0, -1] | None) -> None:
    """Enter the heights of a piece's border into both ends of the steps of the grid; 0 where no border is."""
    first, last = np.searchsorted(grid, [piece.y[0] - 1e-12, piece.y[-1] - 1e-12])
    places = grid[first : last + 1]
    before = np.clip(np.searchsorted(piece.y, places, side="right") - 1, 0, len(piece.y) - 2)
    share = np.clip((places - piece.y[before]) / np.diff(piece.y)[before], 0.0, 1.0)
    z = np.zeros(piece.z.shape[:2]) if column is None else piece.z[:, :, column]
    heights = z[:, before] * (1.0 - share) + z[:, before + 1] * share
    profile[piece.pick, piece.end, first:last] = np.stack([heights[:, :-1], heights[:, 1:]], axis=-1)


def _steps(border: float, grid: Floats, left: Floats, right: Floats) -> Mesh:
    """Stand triangles between two profiles (picks, ends, steps, 2), their open side to the lower one."""
    right = np.where(np.abs(left - right) < LEAST_STEP, left, right)
    rise = left - right
    pick, end, step = np.nonzero((rise != 0).any(axis=-1))
    y = pick + grid[np.stack([step, step + 1])]
    z, other, d = (side[pick, end, step].T for side in (left, right, rise))
    # Where the profiles cross inside a step, both triangles meet in the crossing.
    crossing = d[0] * d[1] < 0
    share = np.divide(d[0], d[0] - d[1], out=np.zeros_like(d[0]), where=crossing)
    meet = np.stack([end + border, y[0] + share * (y[1] - y[0]), z[0] + share * (z[1] - z[0])], axis=-1)
    on_left, on_right = (np.stack(np.broadcast_arrays(end + border, y, h), axis=-1) for h in (z, other))
    third = [np.where(crossing[:, None], meet, corner) for corner in (on_right[1], on_left[0])]
    first, second = [on_right[0], third[0], on_left[0]], [on_right[1], on_left[1], third[1]]
    triangles = np.concatenate([np.stack(first, axis=1)[d[0] != 0], np.stack(second, axis=1)[d[1] != 0]])
    return Mesh(triangles.reshape(-1, 3), np.arange(triangles.size // 3).reshape(-1, 3))


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Return meshes as one, in their order."""
    start = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    vertices = [np.empty((0, 3)), *(mesh.vertices for mesh in meshes)]
    faces = [np.empty((0, 3), np.int64), *(mesh.faces + s for mesh, s in zip(meshes, start[:-1], strict=True))]
    return Mesh(np.concatenate(vertices), np.concatenate(faces))
