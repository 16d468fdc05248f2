"""The point model at k random points of the footprint: what a renderer does without prefiltering [Jin2022Woven].

The points are independent draws from the footprint's kernel; the answer is the ratio of the sums of PHYSICS' patch
integral, as [Chen2024Woven] modified the baseline. Cheap at k = 1; the error falls as k^(-1/2), and what is left
shows as aliasing.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from pipeline.fingerprint import fingerprint
from pipeline.models.options import PointSampledOptions
from pipeline.truth.options import TruthOptions
from pipeline.truth.point_sampler import PointSampler
from pipeline.truth.query import Queries
from weaves.fabric import Fabric


class PointSampled:
    """The baseline with a fixed number of points.

    Parameters
    ----------
    count : int
        Points a query, k.
    footprint : str
        ``gaussian`` or ``box``: the kernel of the truth.
    name : str
        Name of the method.
    """

    def __init__(
        self, count: int, footprint: Literal["gaussian", "box"] = "gaussian", name: str = "point_sampled"
    ) -> None:
        self.name, self.setting = name, f"k = {count}"
        self.count = count
        self._truth = TruthOptions(footprint=footprint)
        self._samplers: dict[str, PointSampler] = {}

    def covers(self, fabric: Fabric) -> bool:
        """Say yes: nothing is learnt."""
        return True

    def prepare(self, fabric: Fabric) -> None:
        """Tabulate the fabric, once."""
        self._sampler(fabric)

    def predict(self, fabric: Fabric, queries: Queries, seed: int = 0) -> npt.NDArray[np.float32]:
        """Answer N queries, float32 (N, 4), with the random numbers named by `seed`."""
        return self._sampler(fabric).sample(queries, self.count, seed)

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the bytes of the tables that the point model reads."""
        return self._sampler(fabric).bytes_stored()

    def _sampler(self, fabric: Fabric) -> PointSampler:
        key = fingerprint(fabric.optics())
        if key not in self._samplers:
            self._samplers[key] = PointSampler(fabric, self._truth)
        return self._samplers[key]


def restore(options: PointSampledOptions, trained: Sequence[tuple[dict[str, Any], Any]]) -> list[PointSampled]:
    """Return one method for each number of points."""
    return [PointSampled(count, options.footprint, options.name) for count in options.counts]
