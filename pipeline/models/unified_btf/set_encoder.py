"""The encoder of `unified_btf`: a texel's angular samples, any number in any order, to its latent [Zaheer2017DeepSets].

A perceptron turns the angles of a sample into m weights; weights times sample are averaged over the samples, and one
layer takes the mean to the latent. All texels of a fabric are seen under the same directions, so that the weights are
computed once for all of them.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

from pipeline.models.networks.losses import to_network
from pipeline.models.networks.perceptron import perceptron
from pipeline.models.unified_btf.angular_samples import TexelSamples
from pipeline.models.unified_btf.options import BtfOptions

ANGLES = 4
"""Numbers that a pair of directions is given as."""

_LAYERS = 2  # hidden ones, before the weights
_COMPONENTS = 4


def angles_of(wi: Tensor, wo: Tensor, kind: str) -> Tensor:
    """Return directions (..., 3), above the cloth, as four numbers (..., 4).

    ``disc``: x and y. ``stereographic``: x and y over 1 + z, which stays smooth at grazing angles.
    """
    if kind == "disc":
        return torch.cat([wi[..., :2], wo[..., :2]], dim=-1)
    return torch.cat([w[..., :2] / (1.0 + w[..., 2:]) for w in (wi, wo)], dim=-1)


class SetEncoder(nn.Module):
    """Angular samples of texels to their latents, whatever the samples' number and order [Zaheer2017DeepSets]."""

    def __init__(self, options: BtfOptions) -> None:
        super().__init__()
        self.weigh = perceptron(ANGLES, options.encoder_hidden, _LAYERS, options.weights)
        self.join = nn.Linear(_COMPONENTS * options.weights, options.latent)
        self.register_buffer("scale", torch.ones(_COMPONENTS))
        self.scale: Tensor

    def forward(self, angles: Tensor, values: Tensor) -> Tensor:
        """Encode T texels seen under the same n pairs of directions.

        Parameters
        ----------
        angles : Tensor (n, 4)
            Directions.
        values : Tensor (n, T, 4)
            Samples.

        Returns
        -------
        Tensor (T, latent)
        """
        count, texels, _ = values.shape
        weights = self.weigh(angles) / count
        mean = (values.flatten(1).t() @ weights).reshape(texels, -1)  # component by component, m numbers each
        scale = self.scale.repeat_interleave(weights.shape[1])
        return functional.relu(functional.linear(mean, self.join.weight * scale, self.join.bias))


class Texels(NamedTuple):
    """Inputs of the encoder from a fabric.

    Attributes
    ----------
    shape : tuple of int
        Rows and columns.
    angles : float32 Tensor (n, 4)
        Directions.
    values : float16 Tensor (n, rows x columns, 4)
        Samples in the encoder's space.
    """

    shape: tuple[int, int]
    angles: Tensor
    values: Tensor

    def to(self, device: torch.device) -> Texels:
        """Return the same on a device."""
        return Texels(self.shape, self.angles.to(device), self.values.to(device))


def read_texels(samples: TexelSamples, options: BtfOptions) -> Texels:
    """Bring samples into the encoder's space, once: half of a training step otherwise."""
    wi, wo, values = (torch.from_numpy(part) for part in (samples.wi, samples.wo, samples.values))
    if options.log_samples:
        values = to_network(values.to(torch.float32), options.log_k).to(torch.float16)
    return Texels(samples.shape, angles_of(wi, wo, options.angles), values)
