"""Estimated errors of a query: one of `selvage` itself, one of the finest soft nodes.

A perceptron of one hidden layer reads the features of `selvage` and puts out the logarithms l of two mean squares. It
learns them by the Gaussian likelihood of errors e with mean 0, whose expectation is least where exp(l) is the mean of
e^2 over all queries with these features:

    loss = l + e^2 exp(-l)

An error is that of a grey cloth's colour, relative to the colour of `selvage` plus `FLOOR`. It contains the noise of
the truth that the network is trained on.
"""

from __future__ import annotations

from typing import Final

import torch
from torch import Tensor, nn
from torch.nn import functional

from pipeline.models.networks.layers import SLOPE
from pipeline.models.selvage import SelvageOptions

FLOOR: Final = 0.05
"""Colour added to the colour that errors are relative to: a third of that of a usual cloth."""

OWN, FINEST = 0, 1
"""Columns of the estimates: of `selvage` itself, of the finest soft nodes."""

_LEAST, _MOST = 1e-8, 4.0  # squares of errors: below the noise of any truth; beyond twice the colour
_START = -6.0  # logarithm of a mean square: an error of 5 %


class ErrorNetwork(nn.Module):
    """The estimate of errors.

    Parameters
    ----------
    options : SelvageOptions
        The design.
    features : int
        Number of features, normalised to mean 0 and deviation 1.
    """

    def __init__(self, options: SelvageOptions, features: int) -> None:
        super().__init__()
        self.hidden = nn.Linear(features, options.error_width)
        self.last = nn.Linear(options.error_width, 2)
        nn.init.zeros_(self.last.weight)
        nn.init.constant_(self.last.bias, _START)

    def forward(self, features: Tensor) -> Tensor:
        """Return logarithms of mean squared relative errors (n, 2) from normalised features (n, features)."""
        found: Tensor = self.last(functional.leaky_relu(self.hidden(features), SLOPE))
        return found

    def loss(self, features: Tensor, errors: Tensor) -> Tensor:
        """Return the mean loss of relative errors (n, 2)."""
        logarithms = self(features)
        squares = errors.square().clamp(_LEAST, _MOST)
        loss: Tensor = (logarithms + squares * torch.exp(-logarithms)).mean()
        return loss


def colour_weights(options: SelvageOptions) -> tuple[float, float, float, float]:
    """Return the weights of the four components in a grey cloth's colour."""
    specular, diffuse = options.specular_colour, options.diffuse_colour
    return specular, specular, diffuse, diffuse
