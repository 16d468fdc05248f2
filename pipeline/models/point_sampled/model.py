"""The point model at k points of the footprint, as in a renderer without prefiltering [Jin2022Woven].

The points are independent draws from the footprint's kernel, or the R2 sequence with one random shift a query
[Roberts2018R2]; the answer is the ratio of the sums over points (pipeline.truth.scattering.point), as [Chen2024Woven]
modified the baseline. Cheap at k = 1; the error falls as k^(-1/2), with R2 somewhat faster, and what is left shows as
aliasing. Visibility is exact, by a march through the cloth in double precision, or looked up in a horizon map in single
precision, at a tenth of the time and with a bias that more points do not lower
(pipeline.analytic.horizon_points.sampler).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from pipeline.analytic.exact_points import PointSampler
from pipeline.analytic.horizon_points.sampler import HorizonSampler
from pipeline.models.per_fabric import PerFabric
from pipeline.models.plain import refuse_other
from pipeline.models.point_sampled.options import PointSampledOptions
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from weaves.fabric import Fabric

Sequence2D = Literal["random", "r2"]


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
    sequence : str
        ``random`` or ``r2``.
    """

    def __init__(
        self,
        count: int,
        footprint: Literal["gaussian", "box"] = "gaussian",
        name: str = "point_sampled",
        sequence: Sequence2D = "random",
    ) -> None:
        self.name, self.setting = name, f"k = {count}"
        self.count, self.sequence = count, sequence
        truth = TruthOptions(footprint=footprint)
        self._samplers = PerFabric(lambda fabric: PointSampler(fabric, truth))

    def covers(self, fabric: Fabric) -> bool:
        """Return True: nothing is learnt."""
        return True

    def prepare(self, fabric: Fabric) -> None:
        """Tabulate the fabric, once."""
        self._samplers.of(fabric)

    def predict(self, fabric: Fabric, queries: Queries, seed: int = 0) -> npt.NDArray[np.float32]:
        """Answer N queries, float32 (N, 4), with the random numbers named by `seed`."""
        return self._samplers.of(fabric).sample(queries, self.count, seed, self.sequence == "r2")

    def transparency(self, fabric: Fabric, looks: Queries, seed: int = 0) -> npt.NDArray[np.float32]:
        """Return the transparency of N footprints, float32 (N,), of the points that `predict` has with this seed."""
        return self._samplers.of(fabric).transparency(looks, self.count, seed, self.sequence == "r2")

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the bytes of the tables that the point model reads."""
        return self._samplers.of(fabric).bytes_stored()


class HorizonSampled:
    """Point sampling with visibility from a horizon map, in single precision, for Gaussian footprints.

    Parameters
    ----------
    count : int
        Points a query, k.
    name : str
        Name of the method.
    sequence : str
        ``random`` or ``r2``.
    samplers : PerFabric
        Horizons of each fabric, shared by methods of different counts.
    """

    def __init__(self, count: int, name: str, sequence: Sequence2D, samplers: PerFabric[HorizonSampler]) -> None:
        self.name, self.setting = name, f"k = {count}"
        self.count, self.sequence = count, sequence
        self._samplers = samplers

    def covers(self, fabric: Fabric) -> bool:
        """Return True: nothing is learnt."""
        return True

    def prepare(self, fabric: Fabric) -> None:
        """Tabulate the fabric's horizons, once."""
        self._samplers.of(fabric)

    def predict(self, fabric: Fabric, queries: Queries, seed: int = 0) -> npt.NDArray[np.float32]:
        """Answer N queries, float32 (N, 4), with the numbers named by `seed`. BadInput if they are not plain."""
        refuse_other(queries, self.name, stretch=True)
        return self._samplers.of(fabric).sample(queries, self.count, self.sequence == "r2", seed)

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the bytes of the horizon map."""
        return self._samplers.of(fabric).bytes_stored()


def restore(
    options: PointSampledOptions, trained: Sequence[tuple[dict[str, Any], Any]]
) -> list[PointSampled] | list[HorizonSampled]:
    """Return one method for each number of points."""
    if options.visibility == "exact":
        return [PointSampled(count, options.footprint, options.name, options.sequence) for count in options.counts]
    soft = options.visibility == "soft_horizon"
    samplers = PerFabric(lambda fabric: HorizonSampler(fabric, options.horizon_nodes, options.azimuths, soft))
    return [HorizonSampled(count, options.name, options.sequence, samplers) for count in options.counts]
