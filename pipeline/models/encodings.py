"""One-blob encoding: a number in [0, 1] as a Gaussian blob spread over bins [Muller2019NIS].

Bin b holds the integral of the Gaussian of standard deviation 1/bins about x over [b/bins, (b + 1)/bins]. The plain
form loses what hangs over the edges; the periodic form wraps it around, so that x = 0 and x = 1 are the same place
and the bins always sum to 1.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor


def one_blob(x: Tensor, bins: int, periodic: bool) -> Tensor:
    """Encode numbers as blobs over bins.

    Parameters
    ----------
    x : Tensor (...)
        Numbers in [0, 1]; any real number when periodic.
    bins : int
        Number of bins, at least 2.
    periodic : bool
        Whether 0 and 1 are the same place.

    Returns
    -------
    Tensor (..., bins)
        Share of the blob in each bin; sums to 1 when periodic, to at most 1 otherwise.
    """
    edges = torch.linspace(0.0, 1.0, bins + 1, dtype=x.dtype, device=x.device)
    distance = edges - x.unsqueeze(-1)
    if not periodic:
        return _gaussian_cdf(distance, bins).diff(dim=-1)
    # A cumulative distribution that grows by exactly 1 a turn: whole turns, plus that of the nearest image.
    turns = (distance + 0.5).floor()
    return (turns + _gaussian_cdf(distance - turns, bins)).diff(dim=-1)


def _gaussian_cdf(distance: Tensor, bins: int) -> Tensor:
    return 0.5 + 0.5 * torch.erf(distance * (bins / math.sqrt(2.0)))


def encoded_size(sigma: Tensor, smallest: float, largest: float) -> Tensor:
    """Map footprints, in repeats, to [0, 1]: the logarithm between `smallest` and `largest`, clamped to it."""
    span = math.log2(largest / smallest)
    return (torch.log2(sigma / smallest) / span).clamp(0.0, 1.0)
