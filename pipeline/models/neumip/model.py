"""A neural texture of one fabric at all scales [Kuznetsov2021NeuMIP].

The centre is first shifted along the view by a learnt depth, as parallax does; then a pyramid of feature textures is
read (pipeline.models.networks.texture); a small perceptron decodes features and directions:

    offset    texture 7 (bilinear) + wo.xy -> 25 -> 25 -> 25 -> 1
              shift = 0.1 output wo.xy / max(wo.z, 0.6), in mean sides of the repeat
    decoder   features 7 + wi.xy + wo.xy -> 25 -> 25 -> 25 -> 4

Head and loss are ADAPTED to the four components: the specular ones are learnt in log space as in `woven`, where the
authors put out RGB as (e^x - 1) times a mask. So are the counts of texels, queries and steps; the published training
takes 45 minutes of a GPU for textures of 512 x 512.

`triple_plane` [Xu2025Comprehensive] reads two more textures of 7 features, of the half vector h and of the difference
vector d, bilinearly at their x and y, and its decoder has no other input:

    h = (wi + wo) / |wi + wo|
    d = wi - wi.(h + z) / (1 + h.z) (h + z) + 2 (wi.h) z       wi in the frame that the shortest turn from z to h gives

The frame of d is a choice of ours. The usual one, which turns with the azimuth of h, jumps where h is the normal.

`hierarchical` [Xue2024Hierarchical] is `neumip` whose decoder reads Fourier inputs beside the features, and has two
inception blocks, parallel branches of one and of two layers whose outputs are joined. Widths and octaves are those of
the authors' code:

    decoder   features 7 + wi.xyz + wo.xyz, 4 octaves of their sines and cosines, 10 of the place's -> 25 -> block ->
              block -> 4
    block     25 -> 10 | 25 -> 12 -> 12 | 25 -> 3 -> 3, ReLU after each layer; as in their code none before the blocks

ADAPTED: the authors train on pictures, and the kernels of the two longer branches span 3 x 3 and 5 x 5 neighbouring
queries, those of a 1-layer branch the maximum of 3 x 3. Here a query is answered by itself, so that kernels have their
middle texel only. The place's sines have whole periods over the repeat, and are means over the footprint
[Barron2021MipNerf]: else footprints of any size would know a place. The loss of gradients compares neighbouring pixels;
rows of a data set have no neighbours.
"""

import itertools
import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np
import torch
from torch import Tensor, nn

from pipeline.models.network import Batch, NetworkMethod, Trained, restored
from pipeline.models.networks.layers import component_error, once_a_place, perceptron, to_components
from pipeline.models.networks.texture import LAYERS, TextureNetwork, random_pyramid, read_texture
from pipeline.models.neumip import HierarchicalOptions, NeumipOptions, TriplePlaneOptions
from weaves.fabric import Fabric


class NeumipNetwork(TextureNetwork):
    """Textures and perceptrons of one fabric."""

    textures: ClassVar[tuple[str, ...]] = ("levels", "depth")
    options: NeumipOptions

    def __init__(self, options: NeumipOptions, repeat: tuple[int, int]) -> None:
        super().__init__(options, repeat)
        self.create_reflectance(2, 2)

    def forward(self, u: Tensor, v: Tensor, sigma: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        """Answer in network space, (n, 4); u, v (n,) are shares of the repeat, sigma is in yarn spacings."""
        features = once_a_place(self.features, u, v, sigma, wo)
        output: Tensor = self.decoder(torch.cat([features, wi[:, :2], wo[:, :2]], dim=-1))
        return output

    def features(self, u: Tensor, v: Tensor, sigma: Tensor, wo: Tensor) -> Tensor:
        """Return the features (n, channels) of places."""
        u, v = self.moved(u, v, sigma, wo, wo[:, :2])
        return self.read(list(self.levels), u, v, sigma)

    def components(self, *inputs: Tensor) -> Tensor:
        """Return the components (n, 4); with `ignore_curvature` 0 where the light is behind the tangent plane."""
        components = to_components(self(*inputs), self.options.log_k)
        return components * (inputs[3][:, 2:] > 0.0) if self.options.ignore_curvature else components

    def loss(self, batch: Batch, random: np.random.Generator) -> Tensor:
        """Return the weighted squared error in network space."""
        options = self.options
        ends, picks = self.repeat
        flat = [column.flatten(0, 1) for column in (batch.u / ends, batch.v / picks, batch.sigma, batch.wi, batch.wo)]
        target = batch.target.flatten(0, 1)
        if options.ignore_curvature:
            # A mean over the rows lit from the front; the others weigh nothing.
            front = (batch.wi.flatten(0, 1)[:, 2:] > 0.0).to(target.dtype)
            share = front.mean().clamp_min(1e-6)
            return component_error(front * self(*flat), front * target, options) / share
        return component_error(self(*flat), target, options)


def _half_and_difference(wi: Tensor, wo: Tensor) -> tuple[Tensor, Tensor]:
    """Return x and y of the half vector and of the difference vector, each (n, 2), of directions (n, 3)."""
    half = nn.functional.normalize(wi + wo, dim=-1)
    height = half[:, 2:].clamp_min(0.0)
    along = ((wi * half).sum(dim=-1, keepdim=True) + wi[:, 2:]) / (1.0 + height)
    return half[:, :2], wi[:, :2] - along * half[:, :2]


class TriplePlaneNetwork(NeumipNetwork):
    """Planes and perceptrons of one fabric."""

    textures: ClassVar[tuple[str, ...]] = (*NeumipNetwork.textures, "directions")
    options: TriplePlaneOptions

    def __init__(self, options: TriplePlaneOptions, repeat: tuple[int, int]) -> None:
        super().__init__(options, repeat)
        channels, side = options.channels, options.direction_texels
        self.decoder = perceptron(3 * channels, options.hidden, LAYERS, 4)
        self.directions = random_pyramid(channels, [(side, side)] * 2)

    def forward(self, u: Tensor, v: Tensor, sigma: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        """Answer in network space, (n, 4); inputs as for `neumip`."""
        features = [once_a_place(self.features, u, v, sigma, wo)]
        first = torch.zeros(len(u), dtype=torch.int64, device=u.device)
        # The disc ends at the centres of the outermost texels, so that nothing wraps.
        scale = 0.5 - 0.5 / self.options.direction_texels
        for plane, vector in zip(self.directions, _half_and_difference(wi, wo), strict=True):
            x, y = (0.5 + scale * vector).unbind(dim=-1)
            features.append(read_texture([plane], x, y, [first]))
        output: Tensor = self.decoder(torch.cat(features, dim=-1))
        return output


class Inception(nn.Module):
    """Parallel branches of one and of two layers, joined to the width of the input; ReLU after each layer."""

    def __init__(self, width: int) -> None:
        super().__init__()
        deep, thin = width // 2, width // 8
        self.branches = nn.ModuleList(
            nn.Sequential(*(part for a, b in itertools.pairwise(widths) for part in (nn.Linear(a, b), nn.ReLU())))
            for widths in ((width, width - deep - thin), (width, deep, deep), (width, thin, thin))
        )

    def forward(self, x: Tensor) -> Tensor:
        """Return numbers (n, width) from as many."""
        return torch.cat([branch(x) for branch in self.branches], dim=-1)


def octaves_of(x: Tensor, count: int, deviation: Tensor | None = None) -> Tensor:
    """Return sines and cosines of x, 2 x, 4 x, ..., `count` of each, (n, 2 count k), of numbers (n, k).

    With a `deviation`, of x's shape, they are means over Gaussians around x.
    """
    powers = 2.0 ** torch.arange(count, device=x.device)
    angles = (x.unsqueeze(-1) * powers).flatten(1)
    share = 1.0 if deviation is None else torch.exp(-0.5 * (deviation.unsqueeze(-1) * powers).square()).flatten(1)
    return torch.cat([share * angles.sin(), share * angles.cos()], dim=-1)


class HierarchicalNetwork(NeumipNetwork):
    """Textures of one fabric, read by inception blocks that also know Fourier inputs."""

    options: HierarchicalOptions

    def __init__(self, options: HierarchicalOptions, repeat: tuple[int, int]) -> None:
        super().__init__(options, repeat)
        of_directions, of_places = options.octaves
        inputs = options.channels + 6 * (1 + 2 * of_directions) + 4 * of_places
        first, *_, last = perceptron(inputs, options.hidden, LAYERS, 4)
        self.decoder = nn.Sequential(first, *(Inception(options.hidden) for _ in range(LAYERS - 1)), last)

    def forward(self, u: Tensor, v: Tensor, sigma: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        """Answer in network space, (n, 4); inputs as for `neumip`."""
        features = once_a_place(self.features, u, v, sigma, wo)
        output: Tensor = self.decoder(torch.cat([features, wi, octaves_of(wi, self.options.octaves[0])], dim=-1))
        return output

    def features(self, u: Tensor, v: Tensor, sigma: Tensor, wo: Tensor) -> Tensor:
        """Return the features of places, and what the decoder knows of place and viewer."""
        of_directions, of_places = self.options.octaves
        place = 2.0 * math.pi * torch.stack([u, v], dim=-1)
        size = 2.0 * math.pi * sigma.unsqueeze(-1) / sigma.new_tensor(self.repeat)
        seen = wo, octaves_of(wo, of_directions), octaves_of(place, of_places, size)
        return torch.cat([super().features(u, v, sigma, wo), *seen], dim=-1)


class Neumip(NetworkMethod[NeumipNetwork]):
    """Trained textures, one network for each fabric; the class tells them from other methods."""


def build(options: NeumipOptions, fabrics: Sequence[Fabric]) -> NeumipNetwork:
    """Return an untrained network; there must be exactly one fabric."""
    (fabric,) = fabrics
    return _network(options, fabric.weave.repeat)


def restore(options: NeumipOptions, trained: Trained) -> list[NetworkMethod[NeumipNetwork]]:
    """Return one method that holds all trained fabrics."""
    kind = NetworkMethod if isinstance(options, TriplePlaneOptions | HierarchicalOptions) else Neumip
    return [kind(*restored(options, trained, lambda repeat: _network(options, repeat)))]


def _network(options: NeumipOptions, repeat: tuple[int, int]) -> NeumipNetwork:
    if isinstance(options, TriplePlaneOptions):
        return TriplePlaneNetwork(options, repeat)
    if isinstance(options, HierarchicalOptions):
        return HierarchicalNetwork(options, repeat)
    return NeumipNetwork(options, repeat)
