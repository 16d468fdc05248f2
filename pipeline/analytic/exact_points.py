"""Point sampling with a fixed number of points, independent or of the R2 sequence: it aliases [Jin2022Woven]."""

import numpy as np

from pipeline.compiled.arrays import Float32
from pipeline.compiled.decorators import allocating_kernel
from pipeline.truth.cloth import AREA_SUM, POINT_SUMS, ClothSide, WideQueries, columns_of
from pipeline.truth.footprint.sequences import derive, independent_pair, r2_pair
from pipeline.truth.monte_carlo import add_point, place_point, query_directions
from pipeline.truth.query import Queries


def sample_points(cloth: ClothSide, queries: Queries, count: int, seed: int, r2: bool = False) -> Float32:
    """Return components and transparency from `count` points a query, (N, 5).

    The viewer is in front, rays count as no lower than 89 degrees. The points are independent, or with `r2` the first
    of that sequence, shifted once a query [Roberts2018R2].
    """
    columns = columns_of(queries.raised() if cloth.parallax else queries)
    return _sample(cloth, columns, count, np.uint64(seed), r2)


@allocating_kernel
def _sample(cloth: ClothSide, columns: WideQueries, count: int, seed: np.uint64, r2: bool) -> Float32:
    rows = len(columns.u)
    mean = np.zeros((rows, AREA_SUM), np.float32)
    sums = np.zeros((1, POINT_SUMS))
    for row in range(rows):
        key = derive(seed, row)
        query = query_directions(columns, row)
        sums[:] = 0.0
        for k in range(count):
            first, second = r2_pair(key, k) if r2 else independent_pair(key, k)
            x, y, weight = place_point(columns, row, cloth, first, second)
            add_point(cloth, x, y, weight, query, sums, 0)
        if sums[0, AREA_SUM] > 0.0:
            mean[row] = sums[0, :AREA_SUM] / sums[0, AREA_SUM]
    return mean
