"""Queries and answers: what a patch BSDF is asked, and what comes back.

A query is one patch seen from one direction and lit from another (pipeline.truth.frames says who is who); an answer
holds the four components.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt


class Queries(NamedTuple):
    """N questions about one fabric.

    Attributes
    ----------
    u, v : float32 (N,)
        Footprint centre, in yarn spacings, along x (weft direction) and y (warp direction).
    sigma : float32 (N,)
        Standard deviation of the footprint along each axis, in yarn spacings, > 0.
    wi, wo : float32 (N, 3)
        Unit vectors to the light and to the viewer.
    """

    u: npt.NDArray[np.float32]
    v: npt.NDArray[np.float32]
    sigma: npt.NDArray[np.float32]
    wi: npt.NDArray[np.float32]
    wo: npt.NDArray[np.float32]

    def take(self, index: npt.NDArray[np.integer] | npt.NDArray[np.bool_] | slice) -> Queries:
        """Return the queries at `index`."""
        return Queries(self.u[index], self.v[index], self.sigma[index], self.wi[index], self.wo[index])


class Answers(NamedTuple):
    """N patch BSDF values with their uncertainty; columns in the order of `frames.COMPONENTS`.

    Attributes
    ----------
    mean, standard_error : float32 (N, 4)
        Components with unit colour and the standard error of each.
    count : int32 (N,)
        Points evaluated.
    """

    mean: npt.NDArray[np.float32]
    standard_error: npt.NDArray[np.float32]
    count: npt.NDArray[np.int32]  # type: ignore[assignment]  # the field's word, though tuples have a count too

    def take(self, index: npt.NDArray[np.integer] | npt.NDArray[np.bool_] | slice) -> Answers:
        """Return the answers at `index`."""
        return Answers(self.mean[index], self.standard_error[index], self.count[index])
