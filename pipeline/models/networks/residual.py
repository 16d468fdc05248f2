"""The residual block of `woven`, and the leaky ReLU that follows each of its layers."""

from __future__ import annotations

from torch import Tensor, nn
from torch.nn import functional

SLOPE = 0.01
"""Slope of the leaky ReLU below 0."""


def activate(x: Tensor) -> Tensor:
    """Apply the leaky ReLU."""
    return functional.leaky_relu(x, SLOPE)


class Residual(nn.Module):
    """Two fully connected layers; the skip is added before the last activation."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.first, self.second = nn.Linear(width, width), nn.Linear(width, width)

    def forward(self, x: Tensor) -> Tensor:
        """Return numbers (..., width) from as many."""
        return activate(x + self.second(activate(self.first(x))))
