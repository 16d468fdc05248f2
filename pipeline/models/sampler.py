"""Importance sampling of directions at a patch of cloth, with their exact density, for path tracers.

An analytic proxy, no network: the flakes' lobes at a few points of the footprint and a cosine on either side
(pipeline.analytic.importance.lobes). It knows the fabric's colours, because they decide how much of the light is
specular.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.analytic.importance.lobes import Lobes, densities, draw, find_lobes
from pipeline.models.method import Method
from pipeline.truth.cloth import cloth_side, columns_of
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from weaves.colour import luminance
from weaves.fabric import Fabric

Floats = npt.NDArray[np.float64]


class Sample(NamedTuple):
    """Drawn directions.

    Attributes
    ----------
    wi : float32 (N, 3)
        Unit vectors to the light, over the whole sphere.
    pdf : float64 (N,)
        Their density, 1/sr.
    """

    wi: npt.NDArray[np.float32]
    pdf: Floats


class Sampler:
    """Draw wi for queries about flat cloth that is seen from the front.

    Parameters
    ----------
    points : int
        Points of the footprint, each a lobe of the mixture.
    widening : float
        Factor on the widening of a lobe by the spread of the tangents; 2 gave the least variance of 1 to 3.
    """

    def __init__(self, points: int = 8, widening: float = 2.0) -> None:
        self.points, self.widening = points, widening

    def sample(self, fabric: Fabric, queries: Queries, random: Floats) -> Sample:
        """Draw one direction a query from numbers in [0, 1), (N, 3); the queries' own wi do not matter."""
        lobes = self._lobes(fabric, queries)
        wo = columns_of(queries).wo
        wi = draw(lobes, wo, np.ascontiguousarray(random, np.float64)).astype(np.float32)
        return Sample(wi, densities(lobes, wi.astype(np.float64), wo))

    def pdf(self, fabric: Fabric, queries: Queries) -> Floats:
        """Return the density of each query's wi, (N,), 1/sr; its integral over the sphere is 1."""
        columns = columns_of(queries)
        return np.asarray(densities(self._lobes(fabric, queries), columns.wi, columns.wo))

    def eval_pdf(
        self, method: Method, fabric: Fabric, queries: Queries, seed: int = 0
    ) -> tuple[npt.NDArray[np.float32], Floats]:
        """Return a method's components (N, 4) for each query, and the density of its wi (N,)."""
        return method.predict(fabric, queries, seed), self.pdf(fabric, queries)

    def _lobes(self, fabric: Fabric, queries: Queries) -> Lobes:
        average = fabric.average()
        yarns = (average.warp, average.weft)
        specular, diffuse, through = (
            np.array([luminance(getattr(yarn, name)) for yarn in yarns])
            for name in ("specular_rgb", "diffuse_rgb", "diffuse_transmission_rgb")
        )
        model = cloth_side(fabric, TruthOptions())
        return find_lobes(model, columns_of(queries), self.points, self.widening, specular, diffuse, through)
