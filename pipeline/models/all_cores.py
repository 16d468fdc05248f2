"""A method that answers many queries on all cores: runs of fixed length on threads of one process.

Kernels and products of matrices run without the interpreter's lock. Where a run begins does not depend on the number
of threads, and each is computed by one thread, so no bit of an answer depends on it either. A benchmark, and whatever
has threads of its own, calls the method itself.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

import numpy as np

from pipeline.compiled.arrays import Float32
from pipeline.cores import cores
from pipeline.fingerprint import fingerprint
from pipeline.models.method import CHUNK_ROWS, Around, Method
from pipeline.models.network import one_thread
from pipeline.truth.query import Queries
from weaves.errors import BadInput
from weaves.fabric import Fabric

Part = TypeVar("Part")


class AllCores(Around):
    """A method, which answers a run of queries on one thread, on several; 0: one a core that this process may use."""

    def __init__(self, method: Method, threads: int = 0) -> None:
        super().__init__(method)
        self._threads = threads

    def predict(
        self, fabric: Fabric, queries: Queries, seed: int = 0, error: float | None = None, time: float | None = None
    ) -> Float32:
        """Answer N queries in runs of `CHUNK_ROWS`, float32 (N, 4); each run but the first has a seed of its own.

        `error` or `time` are the wishes of a method that takes them (`pipeline.models.selvage`); BadInput by others.
        """
        wishes = {key: value for key, value in (("error", error), ("time", time)) if value is not None}
        if wishes and not getattr(self.method, "takes_wishes", False):
            key, value = next(iter(wishes.items()))
            raise BadInput(self.name, key, value, f"leave it out: only selvage answers within a wished {key}")

        def answer(start: int) -> Float32:
            own = int(fingerprint([seed, start]), 16) if start else seed
            return self.method.predict(fabric, queries.take(slice(start, start + CHUNK_ROWS)), own, **wishes)

        starts = range(0, max(len(queries.u), 1), CHUNK_ROWS)
        return np.concatenate(on_all_cores(answer, [(start,) for start in starts], self._threads))


def on_all_cores(answer: Callable[..., Part], tasks: Sequence[tuple[Any, ...]], threads: int = 0) -> list[Part]:
    """Return the answers to the arguments of tasks, by so many threads if there are several; 0: one a core."""
    with one_thread():
        # Before any thread starts, the first task loads kernels and tabulates the fabric.
        first = [answer(*task) for task in tasks[:1]]
        if len(tasks) < 2:
            return first
        with ThreadPoolExecutor(threads or cores()) as pool:
            return [*first, *pool.map(answer, *zip(*tasks[1:], strict=True))]
