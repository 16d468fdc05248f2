"""Which share of a wide footprint falls on each fixed node.

The weight of a node is the Gaussian there, summed over all cells alike and over all images of the repeat: products of
one sum an axis.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from pipeline.truth.gauss.nodes import COPIES, COPY, COUNT_X, COUNT_Y, FIRST, RULE_X, RULE_Y
from pipeline.truth.kernel import fast_kernel
from pipeline.truth.table import Index, Single

_0 = np.float32(0.0)


@fast_kernel
def even_densities(weights: Single, s: np.float32, out: Single) -> None:
    """Write what `axis_densities` tends to for a wide Gaussian: the nodes' weights, as high as its mean."""
    share = s * np.float32(math.sqrt(2.0 * math.pi)) / np.float32(len(out))
    for c in range(len(out)):
        out[c] = weights * share


@fast_kernel
def product_weights(
    pieces: Index,
    copies: Index,
    of_x: Single,
    of_y: Single,
    touched_x: npt.NDArray[np.bool_],
    touched_y: npt.NDArray[np.bool_],
    weight: Single,
) -> None:
    """Write each node's weight: products of both axes, summed over the cells that are alike."""
    weight[:] = _0
    for p in range(len(pieces)):
        first, nx, ny = pieces[p, FIRST], pieces[p, COUNT_X], pieces[p, COUNT_Y]
        for c in range(pieces[p, COPY], pieces[p, COPY] + pieces[p, COPIES]):
            end, pick = copies[c, 0], copies[c, 1]
            if touched_x[end] and touched_y[pick]:
                along_x, along_y = of_x[end, pieces[p, RULE_X]], of_y[pick, pieces[p, RULE_Y]]
                for j in range(ny):
                    line = weight[first + j * nx : first + (j + 1) * nx]
                    for i in range(len(line)):
                        line[i] += along_y[j] * along_x[i]
