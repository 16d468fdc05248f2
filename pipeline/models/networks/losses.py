"""The space networks learn in, and their loss [Chen2024Woven].

Networks put out (g(S_warp), g(S_weft), C_warp, C_weft) with g(x) = ln(k x + 1): highlights span decades, and g
squeezes them. The loss is the mean squared error in that space, with one weight for the specular pair and one for the
diffuse pair.
"""

from __future__ import annotations

import torch
from torch import Tensor

SPECULAR = slice(0, 2)
DIFFUSE = slice(2, 4)


def to_network(components: Tensor, log_k: float) -> Tensor:
    """Take components (..., 4) to network space: g(S) = ln(k S + 1), C unchanged."""
    return torch.cat([torch.log1p(log_k * components[..., SPECULAR]), components[..., DIFFUSE]], dim=-1)


def to_components(output: Tensor, log_k: float) -> Tensor:
    """Take network space (..., 4) to components: S = (e^x - 1)/k, C unchanged, both at least 0."""
    # Half precision would overflow at x = 11.
    output = output.to(torch.promote_types(output.dtype, torch.float32))
    specular = torch.expm1(output[..., SPECULAR]) / log_k
    return torch.cat([specular, output[..., DIFFUSE]], dim=-1).clamp_min_(0.0)


def weighted_error(output: Tensor, target: Tensor, specular_weight: float, diffuse_weight: float) -> Tensor:
    """Return the weighted mean squared error of outputs (..., 4), both in network space."""
    squared = (output - target).square()
    return specular_weight * squared[..., SPECULAR].mean() + diffuse_weight * squared[..., DIFFUSE].mean()
