"""Rows of kind `angular_samples`: the texels of one repeat, each seen under the same pairs of directions.

This is the synthetic bidirectional texture (BTF) that `unified_btf`, `btf_autoencoder` and `universal` read. One repeat
is a grid of texels, each a small Gaussian footprint. All texels of a fabric are seen under the same directions, as
those of a measured texture are; the directions are another random set for every fabric, so that no encoder can memorise
them.

    row n    sample n // texels, texel n % texels; texel t lies in row t // columns, column t % columns of the grid

A row is a query with its answer, so the columns are those of the data set's own rows.
"""

from collections.abc import Callable
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field

from pipeline.fingerprint import stream_seed
from pipeline.shards.queries import QueryOptions, answered, draw_queries
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from weaves.fabric import Fabric
from weaves.validation import Frozen


class AngularSamples(Frozen):
    """Which angular samples of a fabric's texels are computed, and how."""

    kind: Literal["angular_samples"] = "angular_samples"
    texels_per_yarn: int = Field(ge=1)
    """Texels along one yarn spacing."""
    texel_sigma: float = Field(gt=0)
    """Standard deviation of a texel's footprint, in texels."""
    samples: int = Field(ge=1)
    """Pairs of directions, the same for every texel."""
    directions: Literal["projected_disc", "hemisphere"]
    """Density of the directions, and their largest angle, as in `QueryOptions`."""
    max_angle: float = Field(gt=0, le=89.9)
    truth: TruthOptions

    @property
    def queries(self) -> QueryOptions:
        """The distribution that the directions and the one size of footprint are drawn from."""
        size = self.texel_sigma / self.texels_per_yarn
        return QueryOptions(sigma=(size, size), directions=self.directions, max_angle=self.max_angle)

    def grid(self, fabric: Fabric) -> tuple[int, int]:
        """Return the rows and columns of texels of one repeat."""
        ends, picks = fabric.weave.repeat
        return picks * self.texels_per_yarn, ends * self.texels_per_yarn

    def count(self, fabric: Fabric) -> int:
        """Return the number of rows for a fabric."""
        rows, columns = self.grid(fabric)
        return self.samples * rows * columns

    def answer(
        self, fabric: Fabric, start: int, count: int, progress: Callable[[int], None] = lambda done: None
    ) -> dict[str, npt.NDArray[Any]]:
        """Return rows `start` to `start + count` by column; a row depends on optics, grid and its index alone."""
        from pipeline.shards.store import columns_of

        fine = self.texels_per_yarn
        rows, columns = self.grid(fabric)
        grid = self.model_dump(mode="json", include={"texels_per_yarn", "texel_sigma", "directions", "max_angle"})
        seed = stream_seed("angular samples", [fabric.optics(), grid])

        # Directions are by sample, footprints by texel.
        sample, texel = np.divmod(np.arange(start, start + count), rows * columns)
        first = int(sample[0])
        drawn = draw_queries(self.queries, (1, 1), seed, first, int(sample[-1]) - first + 1)
        row, column = np.divmod(texel, columns)
        u, v = (((place + 0.5) / fine).astype(np.float32) for place in (column, row))
        sigma = np.full(count, self.texel_sigma / fine, np.float32)
        queries = Queries.round(u, v, sigma, drawn.wi[sample - first], drawn.wo[sample - first])
        return columns_of(queries, answered(fabric, queries, self.truth, seed, start, progress))
