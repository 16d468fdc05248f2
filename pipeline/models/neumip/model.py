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

from collections.abc import Sequence
from functools import partial
from typing import ClassVar, Final, NamedTuple

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn

from pipeline.models.method import in_repeat
from pipeline.models.network import Answering, Batch, PerQuery, Trained, columns_of, in_chunks
from pipeline.models.networks.layers import (
    LinearLayer,
    layers_of,
    perceptron,
    to_components,
    to_network,
    weighted_error,
)
from pipeline.models.networks.texture import TextureNetwork, level_shapes, random_pyramid, read_pyramid, shifted
from pipeline.models.neumip import NeumipOptions
from pipeline.models.one_material import OneMaterial, restored
from pipeline.truth.query import Queries
from weaves.fabric import Fabric

LAYERS: Final = 3
"""Hidden layers of both perceptrons."""


class NeumipNetwork(TextureNetwork):
    """Textures and perceptrons of one fabric.

    Parameters
    ----------
    options : NeumipOptions
        The design.
    repeat : tuple of int
        Extent of the fabric's repeat in x and y, in yarn spacings.
    """

    textures: ClassVar[tuple[str, ...]] = ("levels", "depth")
    options: NeumipOptions

    def __init__(self, options: NeumipOptions, repeat: tuple[int, int]) -> None:
        super().__init__()
        self.options, self.repeat = options, repeat
        self.shapes = level_shapes(options.texels_per_yarn, options.levels, repeat)  # (rows, columns), finest first
        self.levels = random_pyramid(options.channels, self.shapes)
        self.decoder = perceptron(options.channels + 4, options.hidden, LAYERS, 4)
        self.depth = None
        self.offset: nn.Sequential | None = None
        if options.offset:
            self.depth = nn.Parameter(torch.zeros(options.channels, *self.shapes[0]))
            self.offset = perceptron(options.channels + 2, options.hidden, LAYERS, 1)

    def forward(self, u: Tensor, v: Tensor, sigma: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        """Answer in network space, (n, 4); u, v (n,) are shares of the repeat, sigma is in yarn spacings."""
        if self.offset is not None and self.depth is not None:
            here = read_pyramid([self.depth], u, v, sigma, self.options.texels_per_yarn, self.blur)
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

    def _read_pyramid(self, u: Tensor, v: Tensor, sigma: Tensor) -> Tensor:
        return read_pyramid(list(self.levels), u, v, sigma, self.options.texels_per_yarn, self.blur)


class Parts(NamedTuple):
    """A network for programs without torch.

    Attributes
    ----------
    options : NeumipOptions
        The design.
    levels : list of float32 (rows, columns, channels)
        Textures of the pyramid, finest first; texel (0, 0) is at the smallest v and u.
    depth : float32 (rows, columns, channels) or None
        Offset texture, if the design has one.
    offset : list of LinearLayer
        From texture and wo.xy to the depth; none without it.
    decoder : list of LinearLayer
        From features, wi.xy and wo.xy to the components in network space.
    """

    options: NeumipOptions
    levels: list[npt.NDArray[np.float32]]
    depth: npt.NDArray[np.float32] | None
    offset: list[LinearLayer]
    decoder: list[LinearLayer]


class Neumip(OneMaterial[NeumipNetwork]):
    """Trained textures, one network for each fabric."""

    def predict(self, fabric: Fabric, queries: Queries, seed: int = 0) -> npt.NDArray[np.float32]:
        """Answer N queries, float32 (N, 4); `seed` is not used. BadInput for kinds of queries not trained on."""
        self._refuse(queries)
        answer = partial(_components, self.network_of(fabric))
        return in_chunks(in_repeat(queries, fabric.weave.repeat), answer, self._device)

    def per_query(self, fabric: Fabric) -> PerQuery:
        """Return all of the fabric's network."""
        network, repeat = self.network_of(fabric), fabric.weave.repeat
        module = Answering(network, partial(_components, network))
        return PerQuery(self._refuse, lambda queries: columns_of(in_repeat(queries, repeat)), module)

    def parts(self, fabric: Fabric) -> Parts:
        """Return the fabric's textures and layers."""
        network = self.network_of(fabric)
        return Parts(
            network.options,
            [_texels(texture) for texture in network.levels],
            None if network.depth is None else _texels(network.depth),
            [] if network.offset is None else layers_of(network.offset),
            layers_of(network.decoder),
        )

    def _refuse(self, queries: Queries) -> None:
        if self.domain is not None:
            self.domain.refuse(queries, self.name)


def _texels(texture: Tensor) -> npt.NDArray[np.float32]:
    """Return a texture (channels, rows, columns) texel by texel, (rows, columns, channels)."""
    return np.ascontiguousarray(texture.numpy(force=True).transpose(1, 2, 0))


def _components(network: NeumipNetwork, *columns: Tensor) -> Tensor:
    components = to_components(network(*columns), network.options.log_k)
    return components * (columns[3][:, 2:] > 0.0) if network.options.ignore_curvature else components


def build(options: NeumipOptions, fabrics: Sequence[Fabric]) -> NeumipNetwork:
    """Return an untrained network; there must be exactly one fabric."""
    (fabric,) = fabrics
    return NeumipNetwork(options, fabric.weave.repeat)


def restore(options: NeumipOptions, trained: Trained) -> list[Neumip]:
    """Return one method that holds all trained fabrics."""
    networks, domain = restored(trained, lambda repeat: NeumipNetwork(options, repeat))
    return [Neumip(options.name, networks, domain)]
