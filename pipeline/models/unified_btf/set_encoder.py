"""The encoder of `unified_btf`: a texel's angular samples, any number in any order, to its latent [Zaheer2017DeepSets].

A perceptron turns the angles of a sample into m weights; weights times sample are averaged over the samples, and one
layer takes the mean to the latent. All texels of a fabric are seen under the same directions, so that the weights are
computed once for all of them.

A training reads the samples of its fabrics from shards. A fabric that is added to a trained model brings its samples
with it, as in the paper: computing them is part of the method, and of the time that adding a fabric takes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final
from weakref import WeakValueDictionary

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn
from torch.nn import functional

from pipeline.fingerprint import fingerprint
from pipeline.models.networks.layers import perceptron
from pipeline.models.unified_btf import BtfOptions
from pipeline.truth.conventions import COMPONENTS
from weaves.fabric import Fabric

DIRECTION_NUMBERS = 4
"""Numbers that a pair of directions is given as."""

_LAYERS = 2  # hidden ones, before the weights
_COMPONENTS = 4


@dataclass(frozen=True, eq=False)
class Texels:
    """T texels of one repeat, each seen under the same n pairs of directions: inputs of the encoder."""

    shape: tuple[int, int]
    """Rows and columns of texels; texel t lies in row t // columns, column t % columns."""
    angles: Tensor
    """Directions (`angles_of`), float32 Tensor (n, 4)."""
    values: Tensor
    """Components; their own noise is far above the rounding, float16 Tensor (n, T, 4)."""

    def to(self, device: torch.device) -> Texels:
        """Return the same on a device."""
        return Texels(self.shape, self.angles.to(device), self.values.to(device))


_held: Final[WeakValueDictionary[str, Texels]] = WeakValueDictionary()


def read_texels(fabric: Fabric, options: BtfOptions, columns: Mapping[str, npt.NDArray[Any]]) -> Texels:
    """Return a fabric's texels from the columns of their samples; while they are in use, `texels_of` finds them."""
    shape = options.angular_samples.grid(fabric)
    texels = shape[0] * shape[1]
    wi, wo = (np.stack([columns[f"{name}_{axis}"][::texels] for axis in "xyz"], axis=-1) for name in ("wi", "wo"))
    values = np.stack([columns[name].reshape(len(wi), texels).astype(np.float16) for name in COMPONENTS], axis=-1)
    angles = angles_of(torch.from_numpy(wi), torch.from_numpy(wo), options.angles)
    result = _held[_key(fabric, options)] = Texels(shape, angles, torch.from_numpy(values))
    return result


def texels_of(fabric: Fabric, options: BtfOptions) -> Texels:
    """Return a fabric's texels: those in use in this process, such as a training's, else computed now."""
    texels = _held.get(_key(fabric, options))
    if texels is not None:
        return texels
    wanted = options.angular_samples
    return read_texels(fabric, options, wanted.answer(fabric, 0, wanted.count(fabric)))


def _key(fabric: Fabric, options: BtfOptions) -> str:
    return fingerprint([fabric.optics(), options.angular_samples.model_dump(mode="json"), options.angles])


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
        self.weigh = perceptron(DIRECTION_NUMBERS, options.encoder_hidden, _LAYERS, options.weights)
        self.join = nn.Linear(_COMPONENTS * options.weights, options.latent)
        self.register_buffer("scale", torch.ones(_COMPONENTS))
        self.scale: Tensor

    def forward(self, angles: Tensor, values: Tensor) -> Tensor:
        """Encode T texels seen under the same n pairs of directions, (T, latent).

        `angles` (n, 4) are the directions, `values` (n, T, 4) the samples.
        """
        count, texels, _ = values.shape
        weights = self.weigh(angles) / count
        mean = (values.flatten(1).t() @ weights).reshape(texels, -1)  # component by component, m numbers each
        scale = self.scale.repeat_interleave(weights.shape[1])
        return functional.relu(functional.linear(mean, self.join.weight * scale, self.join.bias))
