"""A neural texture of one fabric at all scales [Kuznetsov2021NeuMIP].

The centre is first shifted along the view by a learnt depth, as parallax does; then a pyramid of feature textures is
read, bilinear within a level and linear between the two levels around log2(sigma / sigma_0), sigma_0 = half a finest
texel; a small perceptron decodes features and directions:

    offset    texture 7 (bilinear) + wo.xy -> 25 -> 25 -> 25 -> 1
              shift = 0.1 output wo.xy / max(wo.z, 0.6), in mean sides of the repeat
    decoder   features 7 + wi.xy + wo.xy -> 25 -> 25 -> 25 -> 4

All textures hold one repeat and wrap. Early in the training they are blurred, and the blur is annealed, so that
coarse structure is learnt first; the offset texture is held fixed later on. Head and loss are ADAPTED to the four
components: the specular ones are learnt in log space as in `woven`, where the authors put out RGB as (e^x - 1) times
a mask. So are the counts of texels, queries and steps; the published training takes 45 minutes of a GPU.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn

from pipeline.models.losses import to_components, to_network, weighted_error
from pipeline.models.method import Batch, in_chunks, in_repeat
from pipeline.models.one_material import OneMaterial, restored
from pipeline.models.options import NeumipOptions
from pipeline.models.texture import FEATURE_SCALE, Perceptron, level_shapes, read_pyramid, shifted
from pipeline.truth.query import Queries
from weaves.fabric import Fabric


class NeumipNetwork(nn.Module):
    """Textures and perceptrons of one fabric.

    Parameters
    ----------
    options : NeumipOptions
        The design.
    repeat : tuple of int
        Extent of the fabric's repeat in x and y, in yarn spacings.
    """

    def __init__(self, options: NeumipOptions, repeat: tuple[int, int]) -> None:
        super().__init__()
        self.options, self.repeat = options, repeat
        self.shapes = level_shapes(options.texels_per_yarn, options.levels, repeat)  # (rows, columns), finest first
        self.levels = nn.ParameterList(
            nn.Parameter(FEATURE_SCALE * torch.randn(options.channels, *shape)) for shape in self.shapes
        )
        self.decoder = Perceptron(options.channels + 4, options.hidden, 4)
        self.depth: nn.Parameter | None = None
        self.offset: Perceptron | None = None
        if options.offset:
            self.depth = nn.Parameter(torch.zeros(options.channels, *self.shapes[0]))
            self.offset = Perceptron(options.channels + 2, options.hidden, 1)
        self._blur = 0.0  # standard deviation, in finest texels

    def forward(self, u: Tensor, v: Tensor, sigma: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        """Answer in network space, (n, 4); u, v (n,) are shares of the repeat, sigma is in yarn spacings."""
        if self.offset is not None and self.depth is not None:
            here = read_pyramid([self.depth], u, v, sigma, self.options.texels_per_yarn, self._now)
            u, v = shifted(self.offset(torch.cat([here, wo[:, :2]], dim=-1)), u, v, wo, self.repeat)
        features = self._read_pyramid(u, v, sigma)
        output: Tensor = self.decoder(torch.cat([features, wi[:, :2], wo[:, :2]], dim=-1))
        return output

    def loss(self, batch: Batch, random: np.random.Generator) -> Tensor:
        """Return the weighted squared error in network space."""
        options = self.options
        ends, picks = self.repeat
        flat = [column.flatten(0, 1) for column in (batch.u / ends, batch.v / picks, batch.sigma, batch.wi, batch.wo)]
        target = to_network(batch.target.flatten(0, 1), options.log_k)
        if options.ignore_curvature:
            # A mean over the rows lit from the front; the others weigh nothing.
            front = (batch.wi.flatten(0, 1)[:, 2:] > 0.0).to(target.dtype)
            share = front.mean().clamp_min(1e-6)
            masked = weighted_error(
                front * self(*flat), front * target, options.specular_weight, options.diffuse_weight
            )
            return masked / share
        return weighted_error(self(*flat), target, options.specular_weight, options.diffuse_weight)

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
        textures = [weight for name, weight in self.named_parameters() if name.split(".")[0] in ("levels", "depth")]
        chosen = {id(weight) for weight in textures}
        others = [weight for weight in self.parameters() if id(weight) not in chosen]
        return [{"params": others, "lr": rate}, {"params": textures, "lr": rate * self.options.texture_rate}]

    def architecture(self) -> dict[str, Any]:
        """Count parameters and name the layers."""
        layers = {name: list(weight.shape) for name, weight in self.named_parameters()}
        total = sum(math.prod(shape) for shape in layers.values())
        textures = sum(math.prod(shape) for name, shape in layers.items() if name.split(".")[0] in ("levels", "depth"))
        counts = {"textures": textures, "perceptrons": total - textures, "total": total}
        return {"parameters": counts, "layers": layers}

    def _read_pyramid(self, u: Tensor, v: Tensor, sigma: Tensor) -> Tensor:
        return read_pyramid(list(self.levels), u, v, sigma, self.options.texels_per_yarn, self._now)

    @property
    def _now(self) -> float:
        return self._blur if self.training else 0.0


class Neumip(OneMaterial[NeumipNetwork]):
    """Trained textures, one network for each fabric."""

    def predict(self, fabric: Fabric, queries: Queries, seed: int = 0) -> npt.NDArray[np.float32]:
        """Answer N queries, float32 (N, 4); `seed` is not used. BadInput for kinds of queries it was not taught."""
        if self.domain is not None:
            self.domain.refuse(queries, self.name)
        network = self.network_of(fabric)

        def answer(*columns: Tensor) -> Tensor:
            components = to_components(network(*columns), network.options.log_k)
            return components * (columns[3][:, 2:] > 0.0) if network.options.ignore_curvature else components

        return in_chunks(in_repeat(queries, fabric.weave.repeat), answer, self._device)


def build(options: NeumipOptions, fabrics: Sequence[Fabric]) -> NeumipNetwork:
    """Return an untrained network; there must be exactly one fabric."""
    (fabric,) = fabrics
    return NeumipNetwork(options, fabric.weave.repeat)


def restore(options: NeumipOptions, trained: Sequence[tuple[dict[str, Any], dict[str, Tensor]]]) -> list[Neumip]:
    """Return one method that holds all trained fabrics."""
    networks, domain = restored(trained, lambda repeat: NeumipNetwork(options, repeat))
    return [Neumip(options.name, networks, domain)]
