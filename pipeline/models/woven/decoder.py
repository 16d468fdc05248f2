"""The decoder of `woven`: latent, patch and directions to the four components; it runs for every query.

The patch P = (u, v, size) enters as one-blobs. OWN CHANGE, `one_blob = "local"`: as published, the decoder has to learn
products of latent and place, and learns them so slowly that small footprints come out as the repeat's average. Here the
first layer sees the encoder's picture of the repeat, 8 x 8 numbers, from the queried place: its 128 filters are
correlated with the picture around the repeat, and read at (u, v) through the footprint's own one-blobs. Both are the
same for all queries of a fabric, so that this costs a query one product of 64 x 128 in place of the latent's, which
moves into the bias. The 24 one-blobs encode the place within the yarn. The decoder has 8,192 parameters more, the
latent 64 numbers.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from pipeline.models.networks.encodings import encoded_size, one_blob, periodic_blob
from pipeline.models.networks.residual import Residual, activate
from pipeline.models.woven.options import WovenOptions

_DIRECTIONS = 5
_FUSED = 64
_SHARPNESS = 0.4  # deviation of the sharpest blob of `local`, in bins


def patch_size(options: WovenOptions) -> int:
    """Return the length of the encoded place and size of a footprint."""
    return 3 if options.one_blob == "none" else 3 * options.bins


def encode_patch(
    options: WovenOptions, u: Tensor, v: Tensor, sigma: Tensor, repeat: Tensor
) -> tuple[Tensor | None, Tensor]:
    """Return the decoder's inputs that describe footprints.

    Parameters
    ----------
    options : WovenOptions
        Options of the one-blobs.
    u, v : Tensor (F, n)
        Centres as shares of the repeat, in [0, 1).
    sigma : Tensor (F, n)
        Footprints, in yarn spacings.
    repeat : Tensor (F, 2)
        Extent of the repeat in x and y, in yarn spacings.

    Returns
    -------
    where : Tensor (F, n, bins^2) or None
        The footprint's share of every entry of the picture, if there is one.
    patch : Tensor (F, n, 3 bins or 3)
        One-blobs, or the bare numbers.
    """
    bins = options.bins
    size = sigma / repeat.prod(dim=-1, keepdim=True).sqrt()
    size = encoded_size(size, options.smallest_size, options.largest_size)
    size = size.unsqueeze(-1) if options.one_blob == "none" else one_blob(size, bins)
    where: Tensor | None = None
    if options.one_blob == "none":
        blobs = [u.unsqueeze(-1), v.unsqueeze(-1)]
    elif options.one_blob == "plain":
        blobs = [one_blob(u, bins), one_blob(v, bins)]
    elif options.one_blob == "periodic":
        blobs = [periodic_blob(u, 1.0 / bins, bins), periodic_blob(v, 1.0 / bins, bins)]
    else:
        sharp, places = (_SHARPNESS / bins) ** 2, ((u, repeat[:, :1]), (v, repeat[:, 1:]))
        column, row = (periodic_blob(x, (sharp + (sigma / period) ** 2).sqrt(), bins) for x, period in places)
        where = (row.unsqueeze(-1) * column.unsqueeze(-2)).flatten(-2)
        spread = (sharp + sigma.square()).sqrt()
        blobs = [bins * periodic_blob(x * period, spread, bins) for x, period in places]
    return where, torch.cat([*blobs, size], dim=-1)


class Decoder(nn.Module):
    """Latents and patches to network space: 86,660 parameters at the default widths, and 8,192 filters if `local`."""

    def __init__(self, options: WovenOptions) -> None:
        super().__init__()
        hidden, patch = options.hidden, patch_size(options)
        self.latent = options.latent
        self.first = nn.Linear(options.latent + patch + (0 if options.spatial_fusion else _DIRECTIONS), hidden)
        self.filters: nn.Linear | None = None
        if options.one_blob == "local":
            self.filters = nn.Linear(options.bins**2, hidden, bias=False)
            step = torch.arange(options.bins)
            around = (step.unsqueeze(-1) + step) % options.bins
            seen = around[:, None, :, None] * options.bins + around[None, :, None, :]
            self.register_buffer("seen", seen.flatten(2).flatten(0, 1), persistent=False)
            self.seen: Tensor
        self.fusion: nn.ModuleList | None = None
        if options.spatial_fusion:
            layers = [nn.Linear(hidden, hidden), nn.Linear(hidden, _FUSED), nn.Linear(_FUSED + _DIRECTIONS, hidden)]
            self.fusion = nn.ModuleList(layers)
        self.mix = Residual(hidden)
        self.narrow = nn.Linear(hidden, _FUSED)
        self.last = nn.Linear(_FUSED, 5 if options.transmission else 4)

    def forward(self, latent: Tensor, where: Tensor | None, patch: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        """Answer in network space, (F, n, 4), transparency appended if `transmission` is learnt.

        Parameters
        ----------
        latent : Tensor (F, latent or latent + bins^2)
            From the encoder.
        where : Tensor (F, n, bins^2) or None
            The footprint's share of every entry of the picture.
        patch : Tensor (F, n, 3 bins or 3)
            One-blobs, or the bare numbers.
        wi, wo : Tensor (F, n, 3)
            Directions.
        """
        directions = torch.cat([wi, wo[..., :2]], dim=-1)
        if self.fusion is None:
            patch = torch.cat([patch, directions], dim=-1)
        # What all queries of a fabric share is multiplied once.
        weight = self.first.weight
        x = functional.linear(patch, weight[:, self.latent :])
        x = x + functional.linear(latent[:, : self.latent], weight[:, : self.latent], self.first.bias).unsqueeze(1)
        if self.filters is not None and where is not None:
            responses = self.filters(latent[:, self.latent :][:, self.seen])
            x = torch.baddbmm(x, where, responses)
        x = activate(x)
        if self.fusion is not None:
            deeper, narrow, angular = self.fusion
            x = activate(narrow(activate(deeper(x))))
            x = activate(angular(torch.cat([x, directions], dim=-1)))
        x = activate(self.narrow(self.mix(x)))
        return activate(self.last(x))
