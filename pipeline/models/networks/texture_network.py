"""Training of networks of textures and perceptrons: `neumip` and `curved` [Kuznetsov2021NeuMIP].

Textures learn faster than perceptrons, because a short training touches each texel rarely. They begin blurred, and the
blur is annealed. The offset texture is held fixed after a share of the training.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar

import torch
from torch import Tensor, nn

from pipeline.models.curved.options import CurvedOptions
from pipeline.models.networks.losses import to_network
from pipeline.models.neumip.options import NeumipOptions


class TextureNetwork(nn.Module):
    """Textures of one fabric, and perceptrons that read them; subclasses create the parts named here.

    Attributes
    ----------
    textures : tuple of str
        Names of those parts that are textures.
    options : NeumipOptions or CurvedOptions
        The design.
    decoder : nn.Sequential
        Puts out the four components in network space.
    depth : nn.Parameter or None
        The offset texture.
    """

    textures: ClassVar[tuple[str, ...]]
    options: NeumipOptions | CurvedOptions
    decoder: nn.Sequential
    depth: nn.Parameter | None

    def __init__(self) -> None:
        super().__init__()
        self._blur = 0.0  # standard deviation, in finest texels

    def start_at(self, target: Tensor) -> None:
        """Set the last bias to the mean target."""
        with torch.no_grad():
            last = self.decoder[-1]
            assert isinstance(last, nn.Linear)
            last.bias.copy_(to_network(target, self.options.log_k).mean(dim=0))

    def schedule(self, progress: float) -> None:
        """Halve the blur again and again, and freeze the offset texture, at `progress` in [0, 1)."""
        options = self.options
        self._blur = options.blur * 2.0 ** (-progress / options.blur_halving)
        if self.depth is not None:
            self.depth.requires_grad_(progress < options.offset_frozen)

    def parameter_groups(self, rate: float) -> list[dict[str, Any]]:
        """Return two groups: perceptrons at `rate`, textures faster."""
        named = list(self.named_parameters())
        perceptrons = [weight for name, weight in named if not self._is_texture(name)]
        textures = [weight for name, weight in named if self._is_texture(name)]
        return [{"params": perceptrons, "lr": rate}, {"params": textures, "lr": rate * self.options.texture_rate}]

    def architecture(self) -> dict[str, Any]:
        """Count parameters and name the layers."""
        layers = {name: list(weight.shape) for name, weight in self.named_parameters()}
        total = sum(math.prod(shape) for shape in layers.values())
        textures = sum(math.prod(shape) for name, shape in layers.items() if self._is_texture(name))
        return {
            "parameters": {"textures": textures, "perceptrons": total - textures, "total": total},
            "layers": layers,
        }

    @property
    def blur(self) -> float:
        """Standard deviation, in finest texels, that textures are read with: 0 unless in training."""
        return self._blur if self.training else 0.0

    def _is_texture(self, name: str) -> bool:
        return name.split(".")[0] in self.textures
