"""Rules of a piece along one axis: Gauss's with the boxes of its nodes, grids of horizons, quantiles of a Gaussian."""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.special import ndtri

from pipeline.compiled.arrays import Float64


class Rule(NamedTuple):
    """Nodes along one axis of a cell."""

    places: Float64
    weights: Float64
    """Positions within the cell; weights that sum to the length, (n,)."""
    borders: Float64  # borders of the nodes' boxes, which are as long as the weights, (n + 1,)


@lru_cache(maxsize=256)
def gauss_rule(low: float, high: float, count: int, radius: float) -> Rule:
    """Return the rule of `count` nodes from `low` to `high`: Gauss's, in v where x = r sin v if `radius` is not 0."""
    s, weight = np.polynomial.legendre.leggauss(count)
    if radius:
        first, last = (math.asin(min(max((end - 0.5) / radius, -1.0), 1.0)) for end in (low, high))
        v = 0.5 * (first + last) + 0.5 * (last - first) * s
        places, weights = 0.5 + radius * np.sin(v), weight * np.cos(v)
    else:
        places, weights = 0.5 * (low + high) + 0.5 * (high - low) * s, weight
    weights = weights * ((high - low) / weights.sum())
    return Rule(places, weights, low + np.concatenate([[0.0], np.cumsum(weights)]))


def grid_edges(low: float, high: float, count: int, radius: float) -> Float64:
    """Return the borders of `count` cells of a grid: evenly from `low` to `high`, or evenly in v."""
    return _between(low, high, np.linspace(0.0, 1.0, count + 1), radius)


def grid_middles(low: float, high: float, count: int, radius: float) -> Float64:
    """Return the middles of the same cells."""
    return _between(low, high, (np.arange(count) + 0.5) / count, radius)


def _between(low: float, high: float, share: Float64, radius: float) -> Float64:
    return 0.5 + radius * np.sin(math.pi * (share - 0.5)) if radius else low + (high - low) * share


def overlap(borders: Float64, edges: Float64) -> Float64:
    """Return which share of each box lies in each cell of a grid, (boxes, cells); rows sum to 1."""
    share = np.minimum(borders[1:, None], edges[None, 1:]) - np.maximum(borders[:-1, None], edges[None, :-1])
    share = np.maximum(share, 0.0)
    return np.asarray(share / np.maximum(share.sum(axis=1, keepdims=True), 1e-300))


def taps(most: int) -> Float64:
    """Return in row n, up to `most`, the places of n readings of one weight: of mean 0 and variance 1.

    They are quantiles of the normal distribution, scaled; one reading is in the middle.
    """
    table = np.zeros((most + 1, most))
    for count in range(2, most + 1):
        places = ndtri((np.arange(count) + 0.5) / count)
        table[count, :count] = places / np.sqrt((places**2).mean())
    return table
