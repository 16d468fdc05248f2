"""Angular samples of a fabric's texels: the synthetic bidirectional texture that an encoder reads.

One repeat is a grid of texels, each a small Gaussian footprint. All texels of a fabric are asked under the same
directions, as a measured texture's are: what an encoder makes of the directions is then computed once for all of them.
The directions are another random set for every fabric, so that no encoder can learn them by heart.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final
from weakref import WeakValueDictionary

import numpy as np
import numpy.typing as npt

from pipeline.fingerprint import fingerprint
from pipeline.models.unified_btf.options import BtfOptions
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.estimator import estimate
from pipeline.truth.query import Queries
from weaves.fabric import Fabric

_BLOCK: Final = 1 << 17  # queries answered at a time


@dataclass(frozen=True, eq=False)
class AngularSamples:
    """T texels of one repeat, each seen under the same n pairs of directions.

    Attributes
    ----------
    shape : tuple of int
        Rows and columns of texels; texel t lies in row t // columns, column t % columns.
    wi, wo : float32 (n, 3)
        Directions.
    values : float16 (n, T, 4)
        Components; their own noise is far above the rounding.
    """

    shape: tuple[int, int]
    wi: npt.NDArray[np.float32]
    wo: npt.NDArray[np.float32]
    values: npt.NDArray[np.float16]


_held: Final[WeakValueDictionary[str, AngularSamples]] = WeakValueDictionary()


def angular_samples(fabric: Fabric, options: BtfOptions) -> AngularSamples:
    """Return a fabric's samples; those that a network in training still holds are not drawn again."""
    key = fingerprint([fabric.optics(), _identity(options)])
    samples = _held.get(key)
    if samples is None:
        _held[key] = samples = draw_samples(fabric, options)
    return samples


def draw_samples(fabric: Fabric, options: BtfOptions) -> AngularSamples:
    """Ask the truth for `options.samples` angular samples of every texel: what adding a fabric costs.

    A sample depends on the fabric's optics, the grid and its own index alone: more samples begin with the same ones.
    """
    ends, picks = fabric.weave.repeat
    fine, count = options.texels_per_yarn, options.samples
    rows, columns = picks * fine, ends * fine
    texels = rows * columns
    row, column = np.divmod(np.arange(texels), columns)
    u, v = ((column + 0.5) / fine).astype(np.float32), ((row + 0.5) / fine).astype(np.float32)
    seed = int(fingerprint(["angular samples", fabric.optics(), _identity(options)["grid"]], 16), 16)
    asked = QueryOptions(directions=options.directions, max_angle=options.max_angle)
    drawn = draw_queries(asked, (1, 1), seed, 0, count)
    values = np.empty((count, texels, 4), np.float16)
    block = max(_BLOCK // texels, 1)
    for start in range(0, count, block):
        wi, wo = drawn.wi[start : start + block], drawn.wo[start : start + block]
        queries = Queries.round(
            np.tile(u, len(wi)),
            np.tile(v, len(wi)),
            np.full(texels * len(wi), options.texel_sigma / fine, np.float32),
            np.repeat(wi, texels, axis=0),
            np.repeat(wo, texels, axis=0),
        )
        answers = estimate(fabric, queries, options.truth, seed, start * texels)
        values[start : start + block] = answers.mean.reshape(len(wi), texels, 4)
    return AngularSamples((rows, columns), drawn.wi, drawn.wo, values)


def _identity(options: BtfOptions) -> dict[str, object]:
    """Return what samples depend on beside the fabric."""
    grid = options.model_dump(mode="json", include={"texels_per_yarn", "texel_sigma", "directions", "max_angle"})
    return {"grid": grid, "count": options.samples, "truth": options.truth.model_dump(mode="json")}
