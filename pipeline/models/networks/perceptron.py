"""Fully connected layers with a ReLU between each two."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from torch import nn


class Layer(NamedTuple):
    """A layer for programs without torch: float32 weights (inputs, outputs) and biases (outputs,)."""

    weights: npt.NDArray[np.float32]
    biases: npt.NDArray[np.float32]


def perceptron(inputs: int, hidden: int, layers: int, outputs: int) -> nn.Sequential:
    """Return a perceptron with `layers` hidden layers of `hidden` numbers; weights are random, biases 0."""
    parts: list[nn.Module] = []
    for a, b in itertools.pairwise([inputs, *[hidden] * layers, outputs]):
        parts += [nn.Linear(a, b), nn.ReLU()]
    network = nn.Sequential(*parts[:-1])
    for layer in network:
        if isinstance(layer, nn.Linear):
            nn.init.kaiming_normal_(layer.weight)
            nn.init.zeros_(layer.bias)
    return network


def layers_of(network: nn.Sequential) -> list[Layer]:
    """Return copies of the layers of a perceptron."""
    linear = (layer for layer in network if isinstance(layer, nn.Linear))
    return [Layer(layer.weight.t().numpy(force=True).copy(), layer.bias.numpy(force=True).copy()) for layer in linear]
