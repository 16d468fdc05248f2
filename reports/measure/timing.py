"""Time of a query: all methods side by side in one process.

All methods answer the same queries, of fabrics with a name and apart from these of unseen ones. They take turns, so
that whatever else the machine does falls on all alike. Each is called a few times before the clock counts. A GPU is
waited for before both readings of the clock. One call answers the queries of several fabrics in turn, because the cost
of the point model depends on the weave. On several threads every thread makes that call, as a renderer gives each of
its threads a tile of the picture; a method itself never uses more than one. Numbers of different machines are never
compared. On one thread, time in which the processor did other work is waiting: on a quiet machine next to nothing.

The energy is that of all packages of the processor, cores that do nothing included, where Linux lets it be read. Its
counters are those of RAPL, which begin again at their range. Some systems let only the administrator read them, some
machines have none, and GPUs are not part of it.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from pipeline.cores import cores
from pipeline.truth.query import Queries
from reports.record import Metric, Record
from weaves.fabric import Fabric

LONGEST: Final = 0.25  # seconds that one timed call of a method, over all its fabrics, should not exceed by much
FEWEST: Final = 16  # least queries a fabric in a call
_ZONES = Path("/sys/class/powercap")


class Contender(NamedTuple):
    """A method and the queries it is timed on."""

    predict: Callable[[Fabric, Queries], object]
    queries: Sequence[tuple[Fabric, Queries]]
    """Fabrics it covers, each with its queries; one timed call answers them all."""
    threads: int = 1  # threads that make the call, each for itself, at the same time

    @property
    def rows(self) -> int:
        """Queries that are answered in one reading of the clock."""
        return self.threads * sum(len(queries.u) for _, queries in self.queries)

    def first(self, rows: int) -> Contender:
        """Return the same with `rows` first queries of the fabric that has most, and of others in proportion."""
        share = min(1.0, rows / max(len(queries.u) for _, queries in self.queries))
        cut = [(fabric, queries.take(slice(math.ceil(share * len(queries.u))))) for fabric, queries in self.queries]
        return self._replace(queries=cut)


class CallTiming(NamedTuple):
    """Cost of a query."""

    samples: tuple[float, ...]  # times of all repeats in nanoseconds, in their order
    processor: float = math.nan  # mean processor time in nanoseconds, of all threads together
    joules: float = math.nan  # mean energy of the processor; NaN where it cannot be read

    @property
    def waited(self) -> float:
        """Share of the time on one thread in which the process did not run, because others did."""
        return max(0.0, 1.0 - self.processor * len(self.samples) / sum(self.samples))


def time_side_by_side(
    contenders: Sequence[Contender], repeats: int, warm_up: int, progress: Callable[[float], None] = lambda share: None
) -> list[CallTiming]:
    """Time methods in turns: so many timed calls of each, after others to warm up.

    `progress` receives the finished share between two rounds.
    """
    set_threads(1)
    elapsed: list[list[int]] = [[] for _ in contenders]
    ran, used = [0] * len(contenders), [0.0] * len(contenders)
    with ThreadPoolExecutor(max((contender.threads for contender in contenders), default=1)) as pool:
        for turn in range(warm_up):
            for contender in contenders:
                _call(contender, pool)
            progress((turn + 1) / (warm_up + repeats))
        for turn in range(repeats):
            for index, contender in enumerate(contenders):
                _synchronise()
                counters, start, ran_before = _counters(), time.perf_counter_ns(), time.process_time_ns()
                _call(contender, pool)
                _synchronise()
                elapsed[index].append(time.perf_counter_ns() - start)
                ran[index] += time.process_time_ns() - ran_before
                used[index] += _joules(counters)
            progress((warm_up + turn + 1) / (warm_up + repeats))
    return [
        CallTiming(tuple(reading / rows for reading in readings), own / rows / repeats, joules / rows / repeats)
        for rows, readings, own, joules in zip((one.rows for one in contenders), elapsed, ran, used, strict=True)
    ]


def affordable(contender: Contender, longest: float = LONGEST, fewest: int = FEWEST) -> Contender:
    """Return the contender with as many of its queries as one call answers in `longest` seconds, on one thread.

    Queries a fabric are doubled from `fewest` on while a call takes at most half of `longest`. Their number is `fewest`
    times a power of 2, or all there are, and so the same in two runs unless a method is near the limit. At most
    `fewest` queries a fabric take longer.
    """
    set_threads(1)
    most = max(len(queries.u) for _, queries in contender.queries)
    rows = fewest
    _answer(contender.first(rows))  # warms up
    # One of three is fast enough: the first call of a size takes new memory, and another program may interrupt one.
    while rows < most and any(
        1e-3 * milliseconds(partial(_answer, contender.first(rows))) <= 0.5 * longest for _ in range(3)
    ):
        rows *= 2
    return contender.first(rows)


def thread_counts(requested: Sequence[int]) -> list[int]:
    """Return numbers of threads in ascending order, each once; 0 means one per core of this process."""
    return sorted({count or cores() for count in requested})


def quartiles(samples: Sequence[float]) -> tuple[float, float, float]:
    """Return first quartile, median and third quartile."""
    low, median, high = (float(q) for q in np.percentile(samples, [25, 50, 75]))
    return low, median, high


def timed(subject: Record, metric: Metric, samples: Sequence[float]) -> Record:
    """Return repeated readings as a Record: their median, their quartiles as its ends, and themselves."""
    low, median, high = quartiles(samples)
    return subject.of(metric, median, len(samples), low=low, high=high, samples=tuple(samples))


def milliseconds(action: Callable[[], object]) -> float:
    """Return how long a single action takes, in milliseconds."""
    _synchronise()
    start = time.perf_counter_ns()
    action()
    _synchronise()
    return 1e-6 * (time.perf_counter_ns() - start)


def set_threads(threads: int) -> None:
    """Set the number of torch's threads, if torch is loaded; kernels have one thread each."""
    if (torch := sys.modules.get("torch")) is not None:
        torch.set_num_threads(threads)


def _counters() -> dict[Path, int]:
    """Read the energy counters of all packages, in microjoules, by their folders; none where they cannot be read."""
    try:
        return {zone: _number(zone / "energy_uj") for zone in sorted(_ZONES.glob("intel-rapl:[0-9]"))}
    except (OSError, ValueError):
        return {}


def _joules(before: dict[Path, int]) -> float:
    """Return the energy since counters were read, in joules; NaN where they cannot be read."""
    try:
        passed = ((_number(zone / "energy_uj") - value, zone) for zone, value in before.items())
        spent = sum(energy % (_number(zone / "max_energy_range_uj") + 1) for energy, zone in passed)
        return 1e-6 * spent if before else math.nan
    except (OSError, ValueError):
        return math.nan


def _number(path: Path) -> int:
    return int(path.read_text())


def _synchronise() -> None:
    """Wait for the GPU, if a method has loaded torch and there is one."""
    if (torch := sys.modules.get("torch")) is not None and torch.cuda.is_available():
        torch.cuda.synchronize()


def _call(contender: Contender, pool: ThreadPoolExecutor) -> None:
    """Answer on as many threads as requested; a single one is this one."""
    if contender.threads == 1:
        _answer(contender)
    else:
        list(pool.map(_answer, [contender] * contender.threads))


def _answer(contender: Contender) -> None:
    for fabric, queries in contender.queries:
        contender.predict(fabric, queries)
