"""Layers that several networks share, the space they learn in, and their loss [Chen2024Woven].

Networks put out (g(S_warp), g(S_weft), C_warp, C_weft) with g(x) = ln(k x + 1): highlights span decades, and g
squeezes them. The loss is the mean squared error there, with a weight of each pair, specular and diffuse.
"""

import itertools
from collections.abc import Callable
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

from pipeline.compiled.arrays import Float32
from pipeline.models.network import QueryNetwork
from pipeline.models.options import ComponentLossOptions

SPECULAR = slice(0, 2)
DIFFUSE = slice(2, 4)
SLOPE = 0.01  # slope of the leaky ReLU below 0


class LinearLayer(NamedTuple):
    """A layer for programs without torch: float32 weights (inputs, outputs) and biases (outputs,)."""

    weights: Float32
    biases: Float32


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


def layers_of(network: nn.Sequential) -> list[LinearLayer]:
    """Return copies of the layers of a perceptron."""
    linear = [(layer.weight.t(), layer.bias) for layer in network if isinstance(layer, nn.Linear)]
    return [LinearLayer(*(values.numpy(force=True).copy() for values in layer)) for layer in linear]


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


def once_a_place(function: Callable[..., Tensor], *columns: Tensor) -> Tensor:
    """Return what a function answers row by row; of alike rows that follow each other only the first is computed.

    So the lights of a place share what does not depend on them. Where more than half of the rows differ from the one
    before, in a training, and in an exported or compiled graph, every row is computed.
    """
    if torch.is_grad_enabled() or torch.compiler.is_compiling() or len(columns[0]) < 2:
        return function(*columns)
    new = torch.ones(len(columns[0]), dtype=torch.bool, device=columns[0].device)
    new[1:] = torch.stack([(x[1:] != x[:-1]).reshape(len(x) - 1, -1).any(dim=1) for x in columns]).any(dim=0)
    rows = new.nonzero()[:, 0]
    if 2 * len(rows) > len(new):
        return function(*columns)
    return function(*(column[rows] for column in columns))[new.cumsum(0) - 1]


class EncoderDecoder(QueryNetwork):
    """A network of two parts, which subclasses create."""

    encoder: nn.Module  # runs once a fabric
    decoder: nn.Module  # runs for every query; all that a renderer keeps beside what was encoded

    def counts(self) -> dict[str, int]:
        """Return the numbers of parameters of both parts."""
        parts = {"encoder": self.encoder, "decoder": self.decoder}
        return {part: sum(weight.numel() for weight in module.parameters()) for part, module in parts.items()}

    def stored(self, constants: tuple[Tensor, ...]) -> int:
        """Return the numbers of the decoder and of what was encoded; the encoder is not needed to render."""
        return self.counts()["decoder"] + sum(constant.numel() for constant in constants)


def _to_network(components: Tensor, log_k: float) -> Tensor:
    """Take components (..., 4) to network space: g(S) = ln(k S + 1), C unchanged."""
    return torch.cat([torch.log1p(log_k * components[..., SPECULAR]), components[..., DIFFUSE]], dim=-1)


def to_components(output: Tensor, log_k: float) -> Tensor:
    """Take network space (..., 4) to components: S = (e^x - 1)/k, C unchanged, both at least 0."""
    # Half precision would overflow at x = 11.
    output = output.to(torch.promote_types(output.dtype, torch.float32))
    specular = torch.expm1(output[..., SPECULAR]) / log_k
    return torch.cat([specular, output[..., DIFFUSE]], dim=-1).clamp_min_(0.0)


def component_error(output: Tensor, target: Tensor, options: ComponentLossOptions) -> Tensor:
    """Return the weighted mean squared error of outputs (..., 4), in network space, from target components (..., 4)."""
    squared = (output - _to_network(target, options.log_k)).square()
    specular, diffuse = squared[..., SPECULAR].mean(), squared[..., DIFFUSE].mean()
    return options.specular_weight * specular + options.diffuse_weight * diffuse


def start_at_mean(last: nn.Linear, target: Tensor, log_k: float) -> None:
    """Set the biases of a last layer to the mean of target components (M, 4), in network space."""
    with torch.no_grad():
        last.bias[:4].copy_(_to_network(target, log_k).mean(dim=0))
