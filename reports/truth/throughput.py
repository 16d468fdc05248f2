"""How fast the ground truth is: points and patch queries a second, beside a plain NumPy version in the same process.

The same of soft nodes and `selvage`, by one thread and by two.

Every rate is the median over repeats of a call that takes long enough for the clock. The NumPy version is what one
writes first: surface and point model by array expressions, visibility from the same table of horizons.
"""

import resource
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, Any, Final

import numpy as np

from pipeline.analytic.soft_nodes.groups import DETAILS
from pipeline.compiled.arrays import Float64, Index, Mask
from pipeline.compiled.decorators import allocating_kernel, kernel
from pipeline.models.analytic.soft_nodes import SoftNodes
from pipeline.models.method import CHUNK_ROWS, Method
from pipeline.models.selvage.model import Selvage
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.cloth import ClothSide, WideQueries, cloth_side, columns_of
from pipeline.truth.estimator import estimate
from pipeline.truth.geometry.heightfield import ALPHA
from pipeline.truth.node_table import kernels
from pipeline.truth.node_table.answer import sum_pieces
from pipeline.truth.node_table.build import FIRST_FINE, NODES_X, NODES_Y, PIECE_FAMILY, ExactNodes
from pipeline.truth.node_table.kernels import FlakeLayer, NodeShares, Normals, Tangents
from pipeline.truth.node_table.tables import FINE
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from reports.measure.timing import quartiles, set_threads
from reports.truth.accuracy import FABRICS, fixed
from reports.truth.row_records import RowRecords
from weaves.fabric import Fabric, load_fabric
from weaves.surface import surface_at

_REPEATS = 5
_TURNS = 15  # of one thread and two
_SEED = 20
_TRAINING: Final = TruthOptions(relative_error=0.05, min_count=64, max_count=1024)  # as the recipes' training rows


@dataclass(frozen=True)
class Rate:
    """One measured speed."""

    what: str  # work that was counted
    fabric: str
    value: Annotated[float, "rate"]  # in `unit`; the median
    low: float  # first quartile
    high: float  # third quartile
    unit: str
    note: str = ""
    count: int = _REPEATS  # timed calls


def measure(rows: int = 2000, fabrics: Sequence[str] = FABRICS) -> Iterator[Rate]:
    """Measure everything with `rows` queries a call; single-threaded but where two threads are compared."""
    set_threads(1)
    yield from _points()
    for name in fabrics:
        yield from _queries(load_fabric(name), rows)
    fabric = load_fabric(fabrics[0])
    yield _threads_compared("queries", fabric, lambda queries: estimate(fabric, queries, _TRAINING, _SEED), 4 * rows)
    yield from _models(fabric)
    yield _memory(fabric, rows)


RECORDS: Final = RowRecords(Rate, setting=("what",), once={name: name for name in ("low", "high", "unit", "note")})


def _rate(
    call: Callable[[], Any], counted: Callable[[Any], float], what: str, fabric: str, unit: str, note: str = ""
) -> Rate:
    """Time a call; `counted` says how much is in its result."""
    call()
    rates = []
    for _ in range(_REPEATS):
        start = time.perf_counter()
        done = call()
        rates.append(counted(done) / (time.perf_counter() - start))
    low, middle, high = quartiles(rates)
    return Rate(what, fabric, middle, low, high, unit, note)


def _points() -> Iterator[Rate]:
    """Yield points a second: vectorised kernels and NumPy."""
    fabric = load_fabric("polyester_lining")
    model = cloth_side(fabric, TruthOptions())
    table = FINE.table(model, False)
    queries = draw_queries(QueryOptions(max_angle=80.0), fabric.weave.repeat, _SEED, 0, 2000)
    columns = columns_of(queries)

    plain = _rate(lambda: _numpy_points(fabric, table, queries), int, "points, NumPy", fabric.name, "points/s")
    yield plain
    shares = kernels.no_shares(table.normal.shape[1])._replace(weight=table.evenly)
    for name, evaluate in (("specular", _evaluate_speculars), ("everything", _evaluate_all)):
        call = partial(evaluate, model, table, columns, shares)
        rate = _rate(call, float, f"points, {name}", fabric.name, "points/s")
        yield replace(rate, note=f"{rate.value / plain.value:.0f} x NumPy")
    traced = partial(estimate, fabric, queries.take(slice(200)), fixed("owen", 1024), _SEED)
    name = "points, by traced view rays"
    yield _rate(traced, lambda answers: answers.count.sum(), name, fabric.name, "points/s", "float64")


@kernel
def _evaluate_speculars(model: ClothSide, table: ExactNodes, columns: WideQueries, shares: NodeShares) -> int:
    """Evaluate the specular share of all nodes for every query; return their number."""
    points, one = 0, np.float32(1.0)
    shares.lit[:] = one
    for row in range(len(columns.u)):
        towards = kernels.node_directions(columns.wi[row], columns.wo[row], len(table.slope))
        for p in range(len(table.pieces)):
            piece = table.pieces[p]
            count, f0 = piece[NODES_X] * piece[NODES_Y], piece[FIRST_FINE]
            f1 = f0 + count
            alpha = model.front.yarn[min(piece[PIECE_FAMILY], 1), ALPHA]
            normal = Normals(table.fine[0, f0:f1], table.fine[1, f0:f1], table.fine[2, f0:f1], table.fine[3, f0:f1])
            tangent = Tangents(table.fine[4, f0:f1], table.fine[5, f0:f1], table.fine[6, f0:f1])
            layer = FlakeLayer(np.float32(alpha**2), np.float32(model.front.thickness), one)
            lit, speculars = shares.lit[:count], shares.speculars[:count]
            kernels.scattered(normal, tangent, towards.light, towards.viewer, one, layer, lit, speculars, None)
            points += count
    return points


@allocating_kernel
def _evaluate_all(model: ClothSide, table: ExactNodes, columns: WideQueries, shares: NodeShares) -> int:
    """Sum all nodes for every query, as the estimator does; return their number."""
    points, sums = 0, np.zeros((3, 5))
    for row in range(len(columns.u)):
        towards = kernels.node_directions(columns.wi[row], columns.wo[row], len(table.slope))
        points += sum_pieces(model, table, towards, shares, sums[0], sums[1], sums[2])[-1]
    return points


def _queries(fabric: Fabric, rows: int) -> Iterator[Rate]:
    """Yield patch queries a second of the default distribution, and what plain Monte Carlo would need."""
    queries = draw_queries(QueryOptions(), fabric.weave.repeat, _SEED, 0, rows)
    start = time.perf_counter()
    model = cloth_side(fabric, TruthOptions())
    FINE.table(model, False)
    built = time.perf_counter() - start
    for options in (_TRAINING, *(TruthOptions(relative_error=error, max_count=1 << 14) for error in (0.02, 0.01))):
        error = options.relative_error
        answers = estimate(fabric, queries, options, _SEED)
        size, doubt = (np.linalg.norm(v, axis=1) for v in (answers.mean, answers.standard_error))
        lit = size > 1e-3
        reached = float(np.mean(doubt[lit] <= error * size[lit]))
        saved = _saved(fabric, queries.take(slice(200)), options)
        note = f"{reached:.0%} state {error:.0%} or less; median {np.median(doubt[lit] / size[lit]):.2%}; "
        note += f"{saved:.0f} x fewer points than mc; table built in {built:.2f} s"
        call, what = partial(estimate, fabric, queries, options, _SEED), f"queries, auto at {error:.0%}"
        yield _rate(call, lambda answers: len(answers.count), what, fabric.name, "queries/s", note)


def _saved(fabric: Fabric, queries: Queries, options: TruthOptions) -> float:
    """Return the median ratio of points that independent sampling needs for the same stated error to those used."""
    answers = estimate(fabric, queries, options, _SEED)
    random = estimate(fabric, queries, fixed("mc", 4096), _SEED)
    doubt, random_doubt = (np.linalg.norm(a.standard_error, axis=1) for a in (answers, random))
    lit = np.linalg.norm(answers.mean, axis=1) > 1e-3
    needed = random.count[lit] * (random_doubt[lit] / np.maximum(doubt[lit], 1e-12)) ** 2
    return float(np.median(needed / answers.count[lit]))


def _threads_compared(what: str, fabric: Fabric, answer: Callable[[Queries], object], rows: int) -> Rate:
    """Return the rate of two threads with `rows` queries each; its note compares the fastest calls of two and of one.

    One thread and two take turns, so that other work on the machine falls on both.
    """
    halves = [draw_queries(QueryOptions(), fabric.weave.repeat, _SEED, k * rows, rows) for k in range(2)]

    def both(apply: Callable[..., Iterable[object]]) -> float:
        start = time.perf_counter()
        list(apply(answer, halves))
        return 2 * rows / (time.perf_counter() - start)

    with ThreadPoolExecutor(2) as pool:
        rates = [(both(map), both(pool.map)) for _ in range(1 + _TURNS)][1:]
    alone, both_at_once = zip(*rates, strict=True)
    low, middle, high = quartiles(both_at_once)
    note = f"{max(both_at_once) / max(alone):.2f} x one thread"
    return Rate(f"{what}, two threads", fabric.name, middle, low, high, "queries/s", note, _TURNS)


def _models(fabric: Fabric) -> Iterator[Rate]:
    """Yield queries a second of soft nodes at all levels and of `selvage`, by one thread and by two."""
    queries = draw_queries(QueryOptions(), fabric.weave.repeat, _SEED, 0, 4 * CHUNK_ROWS)
    methods: list[Method] = [*map(SoftNodes, DETAILS), Selvage()]
    for method in methods:
        what = " ".join(filter(None, ("queries,", method.name, method.setting)))
        answer = partial(method.predict, fabric)
        yield _rate(partial(answer, queries), len, what, fabric.name, "queries/s")
        yield _threads_compared(what, fabric, answer, 4 * CHUNK_ROWS)


def _memory(fabric: Fabric, rows: int) -> Rate:
    """Return what the peak of memory grows by for ten times as many queries, answered in chunks as shards are."""

    def peak(total: int) -> int:
        for start in range(0, total, rows):
            queries = draw_queries(QueryOptions(), fabric.weave.repeat, _SEED, start, rows)
            estimate(fabric, queries, _TRAINING, _SEED, start)
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024

    few, many = peak(2 * rows), peak(20 * rows)
    return Rate("memory for ten times the queries", fabric.name, float(many - few), 0.0, 0.0, "bytes")


def _numpy_points(fabric: Fabric, table: ExactNodes, queries: Queries) -> int:
    """Evaluate random points of the repeat by array expressions; return how many."""
    random, points = np.random.default_rng(1), 20_000
    ends, picks = fabric.weave.repeat
    x, y = random.random(points) * ends, random.random(points) * picks
    nodes = random.integers(0, table.slope.shape[1], points)
    done = 0
    for wi, wo in zip(queries.wi[:4].astype(np.float64), queries.wo[:4].astype(np.float64), strict=True):
        surface = surface_at(fabric, x, y)
        visible = [_clears(table, nodes, w) & (surface.normal @ w > 0) for w in (wi, wo)]
        alpha = np.where(surface.yarn == 0, fabric.warp.roughness, fabric.weft.roughness)
        cos_i, cos_o = (np.maximum(surface.normal @ w, 1e-9) for w in (wi, wo))
        half = (wi + wo) / np.linalg.norm(wi + wo)
        across = np.sum(np.cross(half, surface.tangent) ** 2, axis=-1)
        q = alpha**2 * across + (surface.tangent @ half) ** 2
        density = alpha**3 / (np.pi * q**2)
        sigma_i, sigma_o = (
            np.sqrt(np.sum(np.cross(w, surface.tangent) ** 2, axis=-1) + alpha**2 * (surface.tangent @ w) ** 2)
            for w in (wi, wo)
        )
        depth = fabric.optical_thickness * (sigma_i / cos_i + sigma_o / cos_o)
        specular = density * -np.expm1(-depth) / (4 * (sigma_i * cos_o + sigma_o * cos_i)) * cos_i
        diffuse = (0.5 * cos_i + 0.5 * wi[2]) / np.pi
        area = np.where(visible[1], cos_o / surface.normal[:, 2], 0.0)
        lit = np.where(visible[0], area, 0.0)
        sums = (np.sum(specular * lit), np.sum(diffuse * lit), np.sum(area))
        done += points * bool(np.isfinite(sums).all())
    return done


def _clears(table: ExactNodes, nodes: Index, w: Float64) -> Mask:
    """Return which nodes see a direction, by linear interpolation between two azimuths."""
    place = np.arctan2(w[1], w[0]) / (2 * np.pi) * len(table.slope)
    row = int(np.floor(place))
    share = place - row
    low, high = (table.slope[k % len(table.slope)][nodes] for k in (row, row + 1))
    return np.asarray(w[2] / np.hypot(w[0], w[1]) > low + share * (high - low))
