"""Fully connected layers with a ReLU between each two."""

from __future__ import annotations

import itertools

from torch import nn


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
