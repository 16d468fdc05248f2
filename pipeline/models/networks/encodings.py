"""One-blob encoding: a number as a Gaussian blob spread over bins [Muller2019NIS].

Bin b of a period 1 holds the integral of the Gaussian about x over [b/bins, (b + 1)/bins]. The plain form has the
deviation 1/bins and loses the part beyond the edges. The periodic form wraps it around, so that x = 0 and x = 1 are the
same place and the bins always sum to 1; its deviation is free, so that a blob can be as wide as a footprint makes it.
By its Fourier series, which ends at the bins' own resolution,

    bin b = 1/bins (1 + 2 sum_{m=1}^{bins-1} sinc(m/bins) e^{-2 (pi m deviation)^2} cos(2 pi m (x - (b + 1/2)/bins)))
"""

from __future__ import annotations

import math

import torch
from torch import Tensor


def one_blob(x: Tensor, bins: int) -> Tensor:
    """Encode numbers in [0, 1] as blobs of deviation 1/bins.

    Returns
    -------
    Tensor (..., bins)
        Share of the blob in each bin; at the edges of [0, 1] half of it is lost.
    """
    edges = torch.linspace(0.0, 1.0, bins + 1, dtype=x.dtype, device=x.device)
    distance = edges - x.unsqueeze(-1)
    return (0.5 * torch.erf(distance * (bins / math.sqrt(2.0)))).diff(dim=-1)


def periodic_blob(x: Tensor, deviation: Tensor | float, bins: int) -> Tensor:
    """Encode numbers of period 1 as blobs.

    Parameters
    ----------
    x : Tensor (...)
        Any real numbers.
    deviation : Tensor (...) or float
        Standard deviation, in periods, > 0; wide blobs fill all bins alike.
    bins : int
        Number of bins, at least 2.

    Returns
    -------
    Tensor (..., bins)
        Share of the blob in each bin; sums to 1.
    """
    m = torch.arange(1, bins, dtype=x.dtype, device=x.device)
    phase = 2.0 * math.pi * x.unsqueeze(-1) * m
    if isinstance(deviation, Tensor):
        deviation = deviation.unsqueeze(-1)
    decay = torch.exp(-2.0 * (math.pi * m * deviation) ** 2)
    harmonics = torch.cat([phase.cos() * decay, phase.sin() * decay], dim=-1)

    centres = (torch.arange(bins, dtype=x.dtype, device=x.device) + 0.5) / bins
    angle = 2.0 * math.pi * m.unsqueeze(-1) * centres
    weight = (2.0 / bins) * torch.sinc(m / bins).unsqueeze(-1)
    return 1.0 / bins + harmonics @ torch.cat([weight * angle.cos(), weight * angle.sin()])


def encoded_size(sigma: Tensor, smallest: float, largest: float) -> Tensor:
    """Map footprints, in repeats, to [0, 1]: the logarithm between `smallest` and `largest`, clamped to it."""
    span = math.log2(largest / smallest)
    return (torch.log2(sigma / smallest) / span).clamp(0.0, 1.0)
