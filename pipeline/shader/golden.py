"""Golden vectors: queries of every kind with the answers of pipeline.analytic.

Cells of grids and numbers of nodes are integers: a query may lie so near a step that the last digit of its place
decides. No implementation can be right or wrong on such a query, so it is not golden: the answer may change by at most
STEADY, as a share of the range of its column, if the last digits of its footprint change. Nor is it golden if its view
rays turn over curved cloth: their places there are square roots of small numbers, which lose half of their digits.
"""

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Final, NamedTuple

import numpy as np

from pipeline.analytic.importance.lobes import TZ, Lobes, LobeSurface, find_lobes, point_places
from pipeline.analytic.importance.mixture import density_rows
from pipeline.analytic.soft_nodes.components import read_behind, read_queries
from pipeline.compiled.arrays import Float32, Float64, Mask
from pipeline.scenes.shade import coloured
from pipeline.shader.constants import POINTS, WIDENING
from pipeline.shader.tables import Sides
from pipeline.shader.threads import SeenTints
from pipeline.truth.footprint.mixture import footprints
from pipeline.truth.query import LOWEST_VIEWER, STEEPEST_CURVATURE, Queries
from weaves.colour import LUMINANCE

GOLDEN_COLUMNS: Final = (
    "u", "v", "deviation_x", "deviation_y", "correlation", "wi_x", "wi_y", "wi_z", "wo_x", "wo_y", "wo_z", "curvature"
)  # fmt: skip
"""Columns of a query as the shader takes it."""

STEADY: Final = 1e-5
"""Largest change of a golden answer if the last digits of its footprint change, as a share of the range."""

TRANSPARENCY_COLUMN, DENSITY_COLUMN, ANSWER_COLUMNS = 8, 9, 10
"""Columns of answers after components and bounds, and the number of all."""

COLOUR: Final = slice(-3, None)  # columns of golden answers that follow all others: the patch BSDF in linear RGB, 1/sr
_TRIALS = 4
_DIGITS_OF_LINES = 32  # what is seen on a view line is found by steps: it loses digits in single precision
_LEAST_RISE = 0.05  # of light and viewer
_LEAST_CURVATURE = 0.01
# Deviations of the longer axis, and ratios of the axes, of one kind of footprint after another: points, narrow and
# wide; thin ellipses, long and short, and thick ones; wider than the repeat, and so long that they are shortened.
_FOOTPRINTS = (
    ((0.01, 0.1), (1.0, 1.0)),
    ((0.1, 0.25), (1.0, 1.0)),
    ((0.25, 0.6), (1.0, 1.0)),
    ((0.1, 0.7), (1.6, 6.0)),
    ((0.75, 2.0), (4.0, 8.0)),
    ((0.4, 3.0), (1.1, 2.5)),
    ((0.6, 8.0), (1.0, 1.0)),
    ((60.0, 1000.0), (200.0, 1000.0)),
)
_ON_FIXED_NODES = _FOOTPRINTS[-2:]  # nodes that others place where low rays meet yarns have lost most of their digits


class Group(NamedTuple):
    """Golden queries of one kind: their number, sides of light and viewer, whether cloth is curved, z of viewers."""

    rows: int
    light: float
    viewer: float
    curved: bool
    rise: tuple[float, float] = (_LEAST_RISE, 1.0)


GROUPS: Final = {
    "front": Group(128, 1.0, 1.0, False),
    "grazing": Group(16, 1.0, 1.0, False, (1e-3, LOWEST_VIEWER)),
    "transmitted": Group(64, -1.0, 1.0, False),
    "back": Group(64, -1.0, -1.0, False),
    "back_transmitted": Group(64, 1.0, -1.0, False),
    "curved": Group(64, 1.0, 1.0, True),
    "curved_transmitted": Group(64, -1.0, 1.0, True),
    "low": Group(32, 1.0, 1.0, False, (LOWEST_VIEWER, _LEAST_RISE)),
}
"""Kinds of golden queries; a folder has those that its tables know."""


class Golden(NamedTuple):
    """Queries with their answers.

    `rows`, (N, 12), are GOLDEN_COLUMNS; `answers` are components and bounds, (N, 8), and of models that know them
    transparency and density of wi in the mixture of the lobes, 1/sr, (N, ANSWER_COLUMNS), then COLOUR; `groups` has
    first row and end of each of GROUPS; `steady` is the share of the queries tried that are steady.
    """

    rows: Float32
    answers: Float32
    groups: dict[str, tuple[int, int]]
    steady: float


def rows_of(queries: Queries) -> Float32:
    """Return N queries as the shader takes them, float32 (N, 12)."""
    columns = *footprints(queries), queries.wi, queries.wo, queries.curvature
    return np.column_stack(columns).astype(np.float32)


Answering = Callable[[Queries], Float32]
"""Answers of N queries, all viewers on one side: components and bounds (N, 8), or all ANSWER_COLUMNS."""

Colouring = Callable[[Queries], Float64]
"""Colours of the components of N queries, all viewers on one side, (N, 4, 3); NaN for what cannot be golden."""


def golden(sides: Sides) -> Golden:
    """Return golden queries of a cloth, of all kinds that it knows."""
    curved, behind = len(sides.front.falls) > 0, sides.back is not None
    groups = {
        name: group
        for name, group in GROUPS.items()
        if (curved or not group.curved) and (behind or min(group.light, group.viewer) > 0.0)
    }
    ends, picks = (math.lcm(int(n), len(rows)) for n, rows in zip(sides.front.repeat, sides.tints, strict=True))
    read, depth = partial(read_sides, sides), sides.front.plane - sides.front.lowest
    return golden_of(groups, (ends, picks), read, side_colours(sides), digits=_DIGITS_OF_LINES, depth=depth)


def side_colours(sides: Sides) -> Colouring:
    """Return the function that finds the colours of the components, by what is seen of the threads."""
    means = sides.colours.reshape(3, 2, 3).astype(np.float64)
    differ = max(map(len, sides.tints)) > 1
    seen = [SeenTints(table, sides.tints) for table in (sides.front, sides.back) if table is not None and differ]

    def colours(queries: Queries) -> Float64:
        back = bool(queries.wo[0, 2] < 0.0)
        through = queries.wi[:, 2] * queries.wo[:, 2] < 0.0
        diffuse = np.where(through[:, None, None], means[2], means[1])
        own = np.concatenate([np.broadcast_to(means[0], diffuse.shape), diffuse], axis=1)
        return own * seen[back](queries.turned() if back else queries) if differ else own

    return colours


def golden_of(
    groups: Mapping[str, Group],
    repeat: tuple[int, int],
    read: Answering,
    colours: Colouring,
    stretched: bool = True,
    digits: int = 1,
    depth: float = 0.0,
) -> Golden:
    """Return golden queries over a repeat (ends, picks), footprints all round if not `stretched`.

    Steady are those whose answers stay if the last digits of their footprints change by `digits`, and whose rays do not
    turn down to a `depth` below the reference plane.
    """

    def in_colour(queries: Queries) -> Float32:
        answers = read(queries)
        return np.column_stack([answers, coloured(answers[:, :4], colours(queries))]).astype(np.float32)

    rng = np.random.default_rng(20)
    rows, answers, places, share, stop = [], [], {}, [], 0
    for name, group in groups.items():
        queries = _candidates(repeat, group, rng)
        if not stretched:
            queries = queries._replace(sigma_minor=queries.sigma)
        steady, answer = _steady(in_colour, queries, rng, digits)
        steady &= ~turning(queries, depth)
        chosen = np.flatnonzero(steady)[: group.rows]
        rows.append(rows_of(queries.take(chosen)))
        answers.append(answer[chosen])
        places[name] = stop, stop + len(chosen)
        stop += len(chosen)
        share.append(float(steady.mean()))
    return Golden(np.concatenate(rows), np.concatenate(answers), places, float(np.mean(share)))


def read_sides(sides: Sides, queries: Queries) -> Float32:
    """Return the answers of N queries by pipeline.analytic, float32 (N, ANSWER_COLUMNS); all viewers are on one side.

    Bounds are known with light and viewer on one side; else they are the components.
    """
    table, seen = sides.seen(queries)
    result = np.empty((len(queries.u), ANSWER_COLUMNS), np.float32)
    behind = seen.wi[:, 2] < 0.0
    if not behind.all():
        reflected = read_queries(table, seen.take(~behind))
        result[~behind, :4], result[~behind, 4:8] = reflected.components, reflected.bounds
    if behind.any():
        result[behind, :4] = result[behind, 4:8] = read_behind(table, seen.take(behind))[:, :4]
    if not len(table.behind_grid):
        # Horizons of the other side hide the light, of which the transparency knows nothing.
        table = table._replace(behind_mean=table.mean, behind_sharpness=table.sharpness, behind_grid=table.grid)
    result[:, TRANSPARENCY_COLUMN] = read_behind(table, seen._replace(wi=-seen.wo))[:, 4]
    lobes = lobes_of(sides, queries)
    wi, wo, density = (np.ascontiguousarray(a, np.float32) for a in (queries.wi, queries.wo, result[:, DENSITY_COLUMN]))
    density_rows(lobes, wi, wo, density)
    result[:, DENSITY_COLUMN] = density
    return result


def lobes_of(sides: Sides, looks: Queries) -> Lobes:
    """Return the mixtures of N looks by pipeline.analytic.importance with the grids of `sides`; viewers on one side."""
    table, seen = sides.seen(looks)
    surface = LobeSurface(
        table.repeat, table.yarn, table.thickness, table.uniform, table.piece_starts, table.pieces, table.bounds,
        table.grid.ravel(), table.grid.shape[-1], (sides.colours @ np.array(LUMINANCE, np.float32)).reshape(3, 2),
    )  # fmt: skip
    result = find_lobes(surface, seen, point_places(POINTS), WIDENING)
    if table is sides.back:
        result.flakes[:, TZ] *= np.float32(-1.0)
    return result


def _candidates(repeat: tuple[int, int], group: Group, rng: np.random.Generator) -> Queries:
    """Return twice as many queries as a group has, footprints of every kind by turns, anywhere in the repeat."""
    count = 2 * group.rows
    footprints = np.array(_FOOTPRINTS if group.rise[0] >= LOWEST_VIEWER else _ON_FIXED_NODES)
    kinds = footprints[np.arange(count) % len(footprints)]
    drawn = np.exp(np.log(kinds[:, :, 0]) + rng.random((count, 2)) * np.log(kinds[:, :, 1] / kinds[:, :, 0]))
    sigma, ratio = drawn[:, 0], drawn[:, 1]
    place = rng.random((count, 2)) * repeat
    # Half of the ellipses lie along the yarns.
    angle = np.where(rng.random(count) < 0.5, 0.0, rng.uniform(-0.5, 0.5, count)) * np.pi
    towards = (_front(rng, count), group.light), (_front(rng, count, group.rise), group.viewer)
    wi, wo = (front * np.array([1.0, 1.0, side]) for front, side in towards)
    curvature = np.zeros(count)
    if group.curved:
        curvature = _LEAST_CURVATURE * (STEEPEST_CURVATURE / _LEAST_CURVATURE) ** rng.random(count)
    columns = (place[:, 0], place[:, 1], sigma, wi, wo, sigma / ratio, angle, curvature)
    return Queries(*(np.asarray(column, np.float32) for column in columns))


def _front(rng: np.random.Generator, count: int, rise: tuple[float, float] = (_LEAST_RISE, 1.0)) -> Float32:
    """Return unit vectors, even over the directions in front whose z lies between two, (N, 3)."""
    z, turn = rng.uniform(*rise, count), rng.uniform(0.0, 2.0 * np.pi, count)
    level = np.sqrt(1.0 - z * z)
    return np.column_stack([level * np.cos(turn), level * np.sin(turn), z]).astype(np.float32)


def _steady(read: Answering, queries: Queries, rng: np.random.Generator, digits: int) -> tuple[Mask, Float32]:
    """Return which queries are steady, and the answers of all."""
    answer = read(queries)
    span = np.maximum(np.nanmax(answer, axis=0) - np.nanmin(answer, axis=0), np.float32(1e-30))
    change = np.zeros(len(answer))
    # Places are kept from the corner of a cell: a small one has no more digits there than 1, a large one no fewer.
    place = digits * np.spacing(np.float32(1.0))
    steps = {name: np.maximum(place, np.spacing(getattr(queries, name))) for name in ("u", "v")}
    steps |= {name: digits * np.spacing(getattr(queries, name)) for name in ("sigma", "sigma_minor")}
    for _ in range(_TRIALS):
        moves = {name: np.where(rng.random(len(answer)) < 0.5, -step, step) for name, step in steps.items()}
        moved = queries._replace(**{name: getattr(queries, name) + move for name, move in moves.items()})
        change = np.maximum(change, (np.abs(read(moved) - answer) / span).max(axis=1))
    return np.asarray(change <= STEADY), answer


def turning(queries: Queries, depth: float) -> Mask:
    """Return which view rays over curved cloth turn down to a depth below the reference plane, (N,)."""
    square = np.square(queries.wo.astype(np.float64))
    return np.asarray(square[:, 2] < 2.0 * queries.curvature * (square[:, 0] + square[:, 1]) * depth)
