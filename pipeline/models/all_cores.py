"""A method that answers many queries on all cores: runs of fixed length on threads of one process.

Kernels and products of matrices run without the interpreter's lock. Where a run begins does not depend on the number
of threads, and each is computed by one thread, so no bit of an answer depends on it either. A benchmark, and whatever
has threads of its own, calls the method itself.
"""

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from pipeline.compiled.arrays import Float32
from pipeline.cores import cores
from pipeline.fingerprint import fingerprint
from pipeline.models.method import CHUNK_ROWS, Around, Method
from pipeline.models.network import one_thread
from pipeline.truth.query import Queries
from weaves.errors import BadInput
from weaves.fabric import Fabric


class AllCores(Around):
    """A method, which answers a run of queries on one thread, on several; 0: one a core that this process may use."""

    def __init__(self, method: Method, threads: int = 0) -> None:
        super().__init__(method)
        self._threads = threads or cores()

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
        starts = range(CHUNK_ROWS, len(queries.u), CHUNK_ROWS)

        def answer(start: int) -> Float32:
            own = int(fingerprint([seed, start]), 16)
            return self.method.predict(fabric, queries.take(slice(start, start + CHUNK_ROWS)), own, **wishes)

        with one_thread():
            # Before any thread starts, the first run loads kernels and tabulates the fabric.
            first = self.method.predict(fabric, queries.take(slice(CHUNK_ROWS)), seed, **wishes)
            if not starts:
                return first
            with ThreadPoolExecutor(self._threads) as pool:
                return np.concatenate([first, *pool.map(answer, starts)])
