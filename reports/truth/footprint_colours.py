"""Loss by mean colours of the footprint where ends and picks differ in colour, by size of the footprint.

Methods take the mean colours of the threads in a footprint, weighed by few nodes
(`pipeline.analytic.footprint_colours`); the truth weighs each thread by its share of each component
(`pipeline.truth.scattering.thread_colours`). With the truth's components in both, over random patches of a size and
random directions,

    loss = rms(mean colours - exact colours) / rms(exact colours)
    bias = <mean colours> / <exact colours> - 1

in the patch BSDF's linear RGB. The variance by the sampling of the exact colours is subtracted from the loss.
"""

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from pipeline.analytic.footprint_colours import footprint_colours
from pipeline.scenes.shade import coloured
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.scattering.thread_colours import component_colours
from reports.measure.timing import set_threads
from reports.truth.row_records import RowRecords
from weaves.fabric import load_fabric

_FABRICS: Final = ("gingham", "houndstooth")
_SIZES: Final = (0.15, 0.5, 1.0, 2.0, 4.0, 16.0, 64.0)
_SEED = 41
_PRECISE = TruthOptions(relative_error=0.003, max_count=1 << 16)


@dataclass(frozen=True)
class ColourLoss:
    """Loss by mean colours on one fabric, with footprints of one size."""

    fabric: str
    size: str  # standard deviation of the footprints, in yarn spacings
    loss: Annotated[float, "colour_loss"]
    bias: Annotated[float, "colour_bias"]
    seconds: Annotated[float, "mean_colours_time"]
    exact_seconds: Annotated[float, "exact_colours_time"]  # to a standard error of .3 %
    count: int  # queries


def measure(
    rows: int = 400, fabrics: Sequence[str] = _FABRICS, sizes: Sequence[float] = _SIZES
) -> Iterator[ColourLoss]:
    """Measure the loss on every fabric by every size, single-threaded, with `rows` queries each."""
    set_threads(1)
    for name in fabrics:
        fabric = load_fabric(name)
        for size in sizes:
            options = QueryOptions(sigma=(size, size * (1.0 + 1e-6)))
            queries = draw_queries(options, fabric.repeat, _SEED, 0, rows)
            components = estimate(fabric, queries, TruthOptions(), _SEED).mean
            footprint_colours(fabric, queries.take(slice(1)))  # compiled before it is timed
            begun = time.perf_counter()
            mean = footprint_colours(fabric, queries)
            half = time.perf_counter()
            exact = component_colours(fabric, queries, _PRECISE, _SEED)
            end = time.perf_counter()
            approximate, truth = coloured(components, mean), coloured(components, exact.mean)
            square = float(np.mean((approximate - truth) ** 2) - np.mean(exact.standard_error**2))
            loss = math.sqrt(max(square, 0.0) / float(np.mean(truth**2)))
            bias = float(approximate.mean() / truth.mean() - 1.0)
            yield ColourLoss(name, f"{size:g}", loss, bias, (half - begun) / rows, (end - half) / rows, rows)


RECORDS: Final = RowRecords(ColourLoss, setting=("size",))
