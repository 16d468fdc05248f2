"""Point sampling with a fixed number of points, independent or of the R2 sequence: it aliases [Jin2022Woven]."""

from __future__ import annotations

import numpy as np

from pipeline.compiled.arrays import Float32
from pipeline.compiled.decorators import allocating_kernel
from pipeline.truth.cloth import AREA_SUM, POINT_SUMS, ClothSide, WideQueries, cloth_side, columns_of
from pipeline.truth.footprint.sequences import derive, independent_pair, r2_pair
from pipeline.truth.monte_carlo import add_point, place_point, query_directions
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from weaves.fabric import Fabric


class PointSampler:
    """The baseline with its fabric tabulated once, as a renderer would hold it.

    Parameters
    ----------
    fabric : Fabric
        The cloth.
    options : TruthOptions
        Footprint, frame, normaliser and shadows; the estimator and its limits play no part. Left out: the
        defaults.
    """

    def __init__(self, fabric: Fabric, options: TruthOptions | None = None) -> None:
        self.model = cloth_side(fabric, options or TruthOptions())

    def sample(self, queries: Queries, count: int, seed: int, r2: bool = False) -> Float32:
        """Return the components from `count` points a query, (N, 4); the viewer is in front.

        The points are independent, or with `r2` the first of that sequence, shifted at random once a query
        [Roberts2018R2].
        """
        return _sample(self.model, columns_of(queries), count, np.uint64(seed), r2, 0, 4)

    def transparency(self, looks: Queries, count: int, seed: int, r2: bool = False) -> Float32:
        """Return the share of light from straight behind that passes at the same points, (N,)."""
        return _sample(self.model, columns_of(looks), count, np.uint64(seed), r2, 4, 5)[:, 0]

    @property
    def nbytes(self) -> int:
        """Bytes of the tables that the point model reads."""
        return sum(array.nbytes for array in self.model.front if isinstance(array, np.ndarray))


@allocating_kernel
def _sample(
    model: ClothSide, columns: WideQueries, count: int, seed: np.uint64, r2: bool, first_sum: int, end: int
) -> Float32:
    """Return the ratios of the sums from `first_sum` to `end` of N queries."""
    rows = len(columns.u)
    mean = np.zeros((rows, end - first_sum), np.float32)
    sums = np.zeros((1, POINT_SUMS))
    for row in range(rows):
        key = derive(seed, row)
        query = query_directions(columns, row)
        sums[:] = 0.0
        for k in range(count):
            first, second = r2_pair(key, k) if r2 else independent_pair(key, k)
            x, y, weight = place_point(columns, row, model, first, second)
            add_point(model, x, y, weight, query, sums, 0)
        if sums[0, AREA_SUM] > 0.0:
            for c in range(first_sum, end):
                mean[row, c - first_sum] = sums[0, c] / sums[0, AREA_SUM]
    return mean
