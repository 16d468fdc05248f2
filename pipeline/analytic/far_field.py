"""A BRDF of cloth seen from afar: lobes of both families of threads, fitted to the components of wide footprints."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from pipeline.compiled.arrays import Float32, Float64
from pipeline.truth.query import Queries


class FarField(NamedTuple):
    """Lobes with scales; the first `specular` of them are of the specular component, kind 0, the others diffuse."""

    fill: Callable[..., None]
    """Kernel (*threads, parameters, wi, wo, result): write the K lobes of both families with scale 1, (N, 2, K)."""
    threads: tuple[Float64, ...]  # the arrays of a fabric
    specular: int
    tried: tuple[float, ...]  # parameters that a fit tries
    parameters: Float64  # (2, 2)
    scales: Float64  # (2, K)

    def lobes(self, parameters: Float64, queries: Queries) -> Float64:
        """Return the lobes of N queries with scale 1, (N, 2, K), for parameters (2, 2): family, kind."""
        result = np.zeros((len(queries.wi), *self.scales.shape))
        self.fill(*self.threads, parameters, queries.wi, queries.wo, result)
        return result

    def fitted(self, queries: Queries, components: Float64) -> FarField:
        """Return it with the parameters and scales that give N components (N, 4) with least squared error."""
        parameters, scales, least = self.parameters.copy(), self.scales.copy(), np.full((2, 2), math.inf)
        for value in self.tried:
            basis = self.lobes(np.full((2, 2), value), queries)
            for family in range(2):
                for kind, columns in enumerate((slice(self.specular), slice(self.specular, None))):
                    chosen, error = nnls(basis[:, family, columns], components[:, 2 * kind + family])
                    if error < least[family, kind]:
                        least[family, kind], parameters[family, kind], scales[family, columns] = error, value, chosen
        return self._replace(parameters=parameters, scales=scales)

    def answer(self, queries: Queries) -> Float32:
        """Return the components (N, 4); queries are lit from the front."""
        scaled = self.lobes(self.parameters, queries) * self.scales
        kinds = (scaled[:, :, : self.specular], scaled[:, :, self.specular :])
        return np.concatenate([kind.sum(axis=2) for kind in kinds], axis=1).astype(np.float32)
