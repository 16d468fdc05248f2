"""Weights of the fixed nodes under a wide footprint.

The weight of a node is the Gaussian there, summed over all cells alike and over all images of the repeat: products of
one sum an axis, or a mixture of these for a rotated footprint (pipeline.truth.footprint.mixture).
"""

from __future__ import annotations

import math

import numpy as np

from pipeline.analytic.gauss_nodes.nodes import COPIES, COPY, COUNT_X, COUNT_Y, FIRST, RULE_X, RULE_Y
from pipeline.compiled.arrays import Float32, Index, Mask
from pipeline.compiled.decorators import fast_kernel


@fast_kernel
def even_densities(weights: Float32, s: np.float32, out: Float32) -> None:
    """Write the limit of `axis_densities` for a wide Gaussian: the nodes' weights, times its mean density."""
    share = s * np.float32(math.sqrt(2.0 * math.pi)) / np.float32(len(out))
    for c in range(len(out)):
        for rule in range(len(weights)):
            for k in range(weights.shape[1]):
                out[c, rule, k] = weights[rule, k] * share


@fast_kernel
def product_weights(
    pieces: Index,
    copies: Index,
    of_x: Float32,
    of_y: Float32,
    touched_x: Mask,
    touched_y: Mask,
    share: np.float32,
    weight: Float32,
) -> None:
    """Add `share` times each node's weight: products of both axes, summed over the cells that are alike."""
    for p in range(len(pieces)):
        first, nx, ny = pieces[p, FIRST], pieces[p, COUNT_X], pieces[p, COUNT_Y]
        for c in range(pieces[p, COPY], pieces[p, COPY] + pieces[p, COPIES]):
            end, pick = copies[c, 0], copies[c, 1]
            if touched_x[end] and touched_y[pick]:
                along_x, along_y = of_x[end, pieces[p, RULE_X]], of_y[pick, pieces[p, RULE_Y]]
                for j in range(ny):
                    line, factor = weight[first + j * nx : first + (j + 1) * nx], share * along_y[j]
                    for i in range(len(line)):
                        line[i] += factor * along_x[i]
