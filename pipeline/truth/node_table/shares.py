"""Weights of the nodes of a table for one query: float32 arrays with one number per node."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float32
from pipeline.compiled.decorators import allocating_kernel


class NodeShares(NamedTuple):
    """Shares of the nodes in the sums of one query; overwritten for each query.

    Attributes
    ----------
    weight : float32 (N,)
        Share of the footprint.
    lit : float32 (N,)
        `weight` where the viewer and the light are visible, else 0.
    areas, diffuses, speculars : float32 (N,)
        Share in the denominator, and in the diffuse (times pi) and specular numerators.
    margins, lit_margins : float32 (N,)
        Slope by which the viewer, and viewer and light, lie above the horizon; negative below it.
    undecided : float32 (N,)
        Share in the denominator, were the node visible, if the horizons beside a direction disagree; else 0.
    """

    weight: Float32
    lit: Float32
    areas: Float32
    diffuses: Float32
    speculars: Float32
    margins: Float32
    lit_margins: Float32
    undecided: Float32


@allocating_kernel
def no_shares(nodes: int) -> NodeShares:
    """Return arrays for so many nodes, all 0."""
    return NodeShares(
        np.zeros(nodes, np.float32),
        np.zeros(nodes, np.float32),
        np.zeros(nodes, np.float32),
        np.zeros(nodes, np.float32),
        np.zeros(nodes, np.float32),
        np.zeros(nodes, np.float32),
        np.zeros(nodes, np.float32),
        np.zeros(nodes, np.float32),
    )


@allocating_kernel
def with_weight(shares: NodeShares, weight: Float32) -> NodeShares:
    """Return shares that use other weights; the remaining arrays are the same."""
    return NodeShares(
        weight,
        shares.lit,
        shares.areas,
        shares.diffuses,
        shares.speculars,
        shares.margins,
        shares.lit_margins,
        shares.undecided,
    )
