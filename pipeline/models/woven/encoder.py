"""The encoder of `woven`: maps of one repeat of a cloth to one latent; it runs once a fabric.

Residual convolutions, padded around the repeat, halve the maps four times; fully connected layers join them with the
yarns' parameters. With `one_blob = "local"` it gives a picture of the repeat as well, bins x bins numbers, and the
latent is then the same wherever the repeat begins. The published encoder of the maps is larger.
"""

from __future__ import annotations

import itertools

import torch
from torch import Tensor, nn
from torch.nn import functional

from pipeline.models.networks.residual import SLOPE, Residual, activate
from pipeline.models.woven.cloth import parameter_count
from pipeline.models.woven.options import WovenOptions


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
    """Maps (F, 6, side, side) and parameters (F, 4 or 7) to latents, with a picture appended if it is `local`."""

    def __init__(self, options: WovenOptions) -> None:
        super().__init__()
        channels = [6] + [options.encoder_channels * factor for factor in (1, 2, 4, 4)]
        self.maps = nn.ModuleList(_MapBlock(a, b) for a, b in itertools.pairwise(channels))
        self.local, self.bins = options.one_blob == "local", options.bins
        flat = channels[-1] if self.local else channels[-1] * (options.map_texels // 16) ** 2
        self.flat = nn.Linear(flat, options.latent)
        self.join = nn.Linear(options.latent + parameter_count(options), options.hidden)
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
        x = activate(self.last(self.mix(x)))
        if self.local:
            picture = functional.adaptive_avg_pool2d(self.picture(finer[self.depth]), self.bins)
            x = torch.cat([x, activate(picture.flatten(1))], dim=-1)
        return x
