"""The encoder of `woven`: maps of normal and tangent over one repeat, and the yarns' parameters, to one latent.

It runs once a fabric. Every cloth is brought into standard position first (pipeline.models.woven.standard_position),
and begins at a random yarn in every training step: both are options.

Residual convolutions, padded around the repeat, halve the maps four times; fully connected layers join them with the
yarns' parameters. With `one_blob = "local"` it gives a picture of the repeat as well, bins x bins numbers, and the
latent is then the same wherever the repeat begins. The shape of the paper's is unknown.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from pipeline.compiled.arrays import Float64
from pipeline.models.networks.layers import SLOPE, Residual, activate
from pipeline.models.woven import WovenOptions
from pipeline.models.woven.standard_position import SYMMETRIES, Placement, begun_at, moved, placement, standard
from weaves.fabric import Fabric
from weaves.surface import surface_at


class WovenInputs(NamedTuple):
    """Inputs of the network from F fabrics, in standard position."""

    maps: Tensor
    """Ply normal and fibre tangent at texel centres over one repeat; row = y, column = x, (F, 6, side, side)."""
    parameters: Tensor
    """alpha_warp, alpha_weft, beta_warp, beta_weft; with `transmission` both widths and blends, and the logarithm of
    the optical thickness over its usual value, (F, 4 or 9)."""
    placement: Placement  # transformation of queries into standard position

    def take(self, index: Tensor) -> WovenInputs:
        """Return the fabrics at `index`."""
        placement = Placement(*(part[index] for part in self.placement))
        return WovenInputs(self.maps[index], self.parameters[index], placement)

    def begun(self, shares: Float64) -> WovenInputs:
        """Return the same cloth, each repeat begun elsewhere: `shares` (F, 2) of it to the left and downwards.

        Queries follow exactly, maps to the nearest texel.
        """
        moves = zip(self.maps, np.rint(shares * self.maps.shape[-1]).astype(np.int64).tolist(), strict=True)
        maps = [torch.roll(own, (down, right), dims=(1, 2)) for own, (right, down) in moves]
        start = self.placement.start - torch.from_numpy(shares.astype(np.float32)).to(self.maps.device)
        return WovenInputs(torch.stack(maps), self.parameters, self.placement._replace(start=start))

    def to(self, device: torch.device) -> WovenInputs:
        """Return the same on a device."""
        parts = (part.to(device) for part in self.placement)
        return WovenInputs(self.maps.to(device), self.parameters.to(device), Placement(*parts))


def read_cloth(fabrics: Sequence[Fabric], options: WovenOptions, like: Fabric | None = None) -> WovenInputs:
    """Return the inputs of at least one fabric.

    All are mirrored, exchanged and begun as brings `like` into standard position; without it, each by itself.
    """
    centre = (np.arange(options.map_texels) + 0.5) / options.map_texels
    maps, parameters, placements = [], [], []
    for fabric in fabrics:
        seen, symmetry, start = fabric, SYMMETRIES[0], (0, 0)
        if options.standard:
            seen, symmetry, start = standard(like or fabric)
            seen = seen if like is None else begun_at(moved(fabric, symmetry), start)
        ends, picks = seen.weave.repeat
        surface = surface_at(seen, centre[None, :] * ends, centre[:, None] * picks)
        maps.append(np.concatenate([surface.normal, surface.tangent], axis=-1).transpose(2, 0, 1))
        numbers = [seen.warp.roughness, seen.weft.roughness, seen.warp.relief, seen.weft.relief]
        more = [seen.warp.width, seen.weft.width, seen.warp.blend, seen.weft.blend]
        more += [math.log(seen.optical_thickness / 2.0)]
        parameters.append(numbers + (more if options.transmission else []))
        placements.append(placement(fabric, symmetry, start))
    together = Placement(*(torch.cat(parts) for parts in zip(*placements, strict=True)))
    return WovenInputs(torch.from_numpy(np.array(maps, np.float32)), torch.tensor(parameters), together)


class _MapBlock(nn.Module):
    """A residual block of convolutions that halves the map; padding wraps, because the repeat does."""

    def __init__(self, channels_in: int, channels_out: int) -> None:
        super().__init__()
        self.first = nn.Conv2d(channels_in, channels_out, 3, stride=2, padding=1, padding_mode="circular")
        self.second = nn.Conv2d(channels_out, channels_out, 3, padding=1, padding_mode="circular")

    def forward(self, x: Tensor) -> Tensor:
        x = activate(self.first(x))
        return activate(x + self.second(x))


class Encoder(nn.Module):
    """Maps (F, 6, side, side) and parameters (F, 4 or 9) to latents, with a picture appended if it is `local`."""

    def __init__(self, options: WovenOptions) -> None:
        super().__init__()
        channels = [6] + [options.encoder_channels * factor for factor in (1, 2, 4, 4)]
        self.maps = nn.ModuleList(_MapBlock(a, b) for a, b in itertools.pairwise(channels))
        self.local, self.bins = options.one_blob == "local", options.bins
        flat = channels[-1] if self.local else channels[-1] * (options.map_texels // 16) ** 2
        self.flat = nn.Linear(flat, options.latent)
        self.join = nn.Linear(options.latent + (9 if options.transmission else 4), options.hidden)
        self.deeper = nn.Linear(options.hidden, options.hidden) if options.extra_layer == "encoder" else None
        self.mix = Residual(options.hidden)
        self.last = nn.Linear(options.hidden, options.latent)
        if self.local:
            # Taken where the maps are as fine as the picture, or the next coarser.
            self.depth = min(max((options.map_texels // options.bins).bit_length() - 1, 1), len(self.maps))
            wide = channels[self.depth]
            convolution = nn.Conv2d(wide, wide, 3, padding=1, padding_mode="circular")
            self.picture = nn.Sequential(convolution, nn.LeakyReLU(SLOPE), nn.Conv2d(wide, 1, 1))

    def forward(self, maps: Tensor, parameters: Tensor) -> Tensor:
        """Return latents (F, latent), or with the picture (F, latent + bins^2)."""
        finer = [maps]
        for block in self.maps:
            finer.append(block(finer[-1]))
        # What lies where is the picture's part, if there is one; the rest is then the same wherever the repeat begins.
        x = finer[-1].mean(dim=(2, 3)) if self.local else finer[-1].flatten(1)
        x = activate(self.join(torch.cat([activate(self.flat(x)), parameters], dim=-1)))
        if self.deeper is not None:
            x = activate(self.deeper(x))
        x = activate(self.last(self.mix(x)))
        if self.local:
            picture = functional.adaptive_avg_pool2d(self.picture(finer[self.depth]), self.bins)
            x = torch.cat([x, activate(picture.flatten(1))], dim=-1)
        return x
