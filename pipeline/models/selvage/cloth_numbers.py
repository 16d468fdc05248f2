"""Numbers of a cloth that its errors depend on: how far its answers differ from one another on some flat queries."""

from typing import Final

import numpy as np

from pipeline.compiled.arrays import Float64
from pipeline.models.analytic.soft_nodes import Level, SoftNodes
from pipeline.models.fallback import fallback_answers
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.query import Queries
from weaves.fabric import Fabric

NODE_LEVELS: Final[tuple[Level, ...]] = (0, 1, 2, 4, 8)
"""Levels of detail of the soft nodes, from the cheapest on. The answers are theirs, then that of the fallback."""

FLOOR: Final = 0.05  # colour added to the colour that errors are relative to: a third of that of a usual cloth
GREY: Final = np.array([0.3, 0.3, 0.5, 0.5])  # weights of the four components in a grey cloth's colour
NUMBERS: Final = len(NODE_LEVELS) + 1  # numbers of a cloth, the first of them 1
_FINEST: Final = len(NODE_LEVELS) - 1  # answer that the others are compared with
_ROWS: Final = 2048  # single queries decide fewer numbers of more of them
_EVERY: Final = 2  # of them is answered by the fallback, which takes longest
_SEED: Final = 0xC107
_LEAST, _MOST = 1e-3, 1.0  # differences
_MIDDLE = 4.0  # minus the logarithm of a usual difference


def probed(fabric: Fabric, behind: bool) -> Float64:
    """Return the `colours` of queries of flat cloth with light from one side; most without the fallback's."""
    return colours(fabric, probes(fabric, behind, False), _EVERY)


def probes(
    fabric: Fabric,
    behind: bool,
    curved: bool,
    rows: int = _ROWS,
    seed: int = _SEED,
    directions: tuple[str, ...] = ("projected_disc", "hemisphere"),
) -> Queries:
    """Return random queries of one case, footprints of all sizes and shapes, in equal parts with each distribution."""
    shape = QueryOptions(behind=float(behind), stretch=8.0)
    if curved:
        shape = QueryOptions(behind=float(behind), stretch=4.0, curvature=(0.01, 0.5))
    parts, each = [], rows // len(directions)
    for index, name in enumerate(directions):
        options = shape.model_copy(update={"directions": name})
        parts.append(draw_queries(options, fabric.weave.repeat, seed + index, 0, each))
    return Queries(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def colours(fabric: Fabric, queries: Queries, every: int = 1) -> Float64:
    """Return a grey cloth's colour by all answers, (N, answers); by the fallback for one of `every` rows, else NaN."""
    answers = [SoftNodes(level).predict(fabric, queries) for level in NODE_LEVELS]
    last = np.full(len(queries.u), np.nan)
    last[::every] = fallback_answers(fabric, queries.take(slice(None, None, every)), 0) @ GREY
    return np.stack([*(answer @ GREY for answer in answers), last], axis=1)


def numbers_of(colours: Float64) -> Float64:
    """Return the numbers of a cloth with these colours of its answers, (NUMBERS,)."""
    finest = colours[:, [_FINEST]]
    squares = np.minimum(((np.delete(colours, _FINEST, axis=1) - finest) / (finest + FLOOR)) ** 2, _MOST)
    logarithms = np.log(np.maximum(np.sqrt(np.nanmean(squares, axis=0)), _LEAST))
    return np.append(1.0, logarithms + _MIDDLE)
