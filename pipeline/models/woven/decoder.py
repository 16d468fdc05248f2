"""The decoder of `woven`: latent, patch and directions to the four components; it runs for every query.

The patch P = (u, v, size) enters as one-blobs. OWN CHANGE, `one_blob = "local"`: as published, the decoder has to learn
products of latent and place, and learns them so slowly that small footprints come out as the repeat's average. Here the
first layer sees the encoder's picture of the repeat, 8 x 8 numbers, from the queried place: its 128 filters are
correlated with the picture around the repeat, and read at (u, v) through the footprint's own one-blobs. Both are the
same for all queries of a fabric, so that this costs a query one product of 64 x 128 in place of the latent's, which
moves into the bias. The 24 one-blobs encode the place within the yarn. The decoder has 8,192 parameters more, the
latent 64 numbers.

One-blob encoding is a number as a Gaussian blob spread over bins [Muller2019NIS].
Bin b of a period 1 holds the integral of the Gaussian about x over [b/bins, (b + 1)/bins]. The plain form has the
deviation 1/bins and loses the part beyond the edges. The periodic form wraps it around, so that x = 0 and x = 1 are the
same place and the bins always sum to 1; its deviation is free, so that a blob can be as wide as a footprint makes it.
By its Fourier series, which ends at the bins' own resolution,

    bin b = 1/bins (1 + 2 sum_{m=1}^{bins-1} sinc(m/bins) e^{-2 (pi m deviation)^2} cos(2 pi m (x - (b + 1/2)/bins)))
"""

import math
from typing import Final, cast

import torch
from torch import Tensor, nn
from torch.nn import functional

from pipeline.models.networks.layers import LinearLayer, Residual, activate
from pipeline.models.woven import WovenOptions

_DIRECTIONS = 5
_LIGHT = slice(-5, -2)  # inputs of a layer that are wi; wo follows
_FUSED = 64
SHARPNESS: Final = 0.4  # deviation of the sharpest blob of `local`, in bins


def one_blob(x: Tensor, bins: int) -> Tensor:
    """Encode numbers in [0, 1] as blobs of deviation 1/bins, (..., bins); at the edges half of a blob is lost."""
    edges = torch.linspace(0.0, 1.0, bins + 1, dtype=x.dtype, device=x.device)
    distance = edges - x.unsqueeze(-1)
    return (0.5 * torch.erf(distance * (bins / math.sqrt(2.0)))).diff(dim=-1)


def periodic_blob(x: Tensor, deviation: Tensor | float, bins: int) -> Tensor:
    """Encode numbers of period 1 as the shares of blobs in each of at least 2 bins, (..., bins), which sum to 1.

    `deviation` is the standard deviation, in periods, > 0; wide blobs fill all bins alike.
    """
    m = torch.arange(1, bins, dtype=x.dtype, device=x.device)
    phase = 2.0 * math.pi * x.unsqueeze(-1) * m
    if isinstance(deviation, Tensor):
        deviation = deviation.unsqueeze(-1)
    decay = torch.exp(-2.0 * (math.pi * m * deviation) ** 2)
    harmonics = torch.cat([phase.cos() * decay, phase.sin() * decay], dim=-1)
    return 1.0 / bins + harmonics @ harmonic_weights(m, bins)


def harmonic_weights(m: Tensor, bins: int) -> Tensor:
    """Return the weights of cosines and sines of 1 to bins - 1 periods, `m`, in each bin, (2 bins - 2, bins)."""
    centres = (torch.arange(bins, dtype=m.dtype, device=m.device) + 0.5) / bins
    angle = 2.0 * math.pi * m.unsqueeze(-1) * centres
    weight = (2.0 / bins) * torch.sinc(m / bins).unsqueeze(-1)
    return torch.cat([weight * angle.cos(), weight * angle.sin()])


def encoded_size(sigma: Tensor, smallest: float, largest: float) -> Tensor:
    """Map footprints, in repeats, to [0, 1]: the logarithm between `smallest` and `largest`, clamped to it."""
    return (torch.log2(sigma / smallest) / math.log2(largest / smallest)).clamp(0.0, 1.0)


def encode_patch(
    options: WovenOptions, u: Tensor, v: Tensor, sigma: Tensor, repeat: Tensor
) -> tuple[Tensor | None, Tensor]:
    """Return the decoder's inputs that describe footprints.

    Centres u and v (F, n) are shares of the repeat (F, 2), in [0, 1), sigma (F, n) in yarn spacings. The first input is
    the footprint's share of every entry of the picture, (F, n, bins^2), or None without a picture; the second
    one-blobs, or the bare numbers, (F, n, 3 bins or 3).
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
        sharp, places = (SHARPNESS / bins) ** 2, ((u, repeat[:, :1]), (v, repeat[:, 1:]))
        column, row = (periodic_blob(x, (sharp + (sigma / period) ** 2).sqrt(), bins) for x, period in places)
        where = (row.unsqueeze(-1) * column.unsqueeze(-2)).flatten(-2)
        spread = (sharp + sigma.square()).sqrt()
        blobs = [bins * periodic_blob(x * period, spread, bins) for x, period in places]
    return where, torch.cat([*blobs, size], dim=-1)


class Decoder(nn.Module):
    """Latents and patches to network space; the filters of `local` are 8,192 parameters at the default widths."""

    def __init__(self, options: WovenOptions) -> None:
        super().__init__()
        hidden, patch = options.hidden, 3 if options.one_blob == "none" else 3 * options.bins
        self.options, self.latent = options, options.latent
        self.first = nn.Linear(options.latent + patch + (0 if options.spatial_fusion else _DIRECTIONS), hidden)
        self.filters: nn.Linear | None = None
        if options.one_blob == "local":
            self.filters = nn.Linear(options.bins**2, hidden, bias=False)
            step = torch.arange(options.bins)
            around = (step.unsqueeze(-1) + step) % options.bins
            seen = around[:, None, :, None] * options.bins + around[None, :, None, :]
            self.register_buffer("seen_cells", seen.flatten(2).flatten(0, 1), persistent=False)
            self.seen_cells: Tensor
        self.fusion: nn.ModuleList | None = None
        if options.spatial_fusion:
            deeper = [nn.Linear(hidden, hidden)] if options.extra_layer == "fusion" else []
            self.fusion = nn.ModuleList([*deeper, nn.Linear(hidden, _FUSED), nn.Linear(_FUSED + _DIRECTIONS, hidden)])
        self.mix = Residual(hidden)
        self.narrow = nn.Linear(hidden, _FUSED)
        self.last = nn.Linear(_FUSED, 5 if options.transmission else 4)

    def seen(self, latent: Tensor, where: Tensor | None, patch: Tensor, wo: Tensor) -> Tensor:
        """Return what the lights of a place share, (F, n, hidden): the layer that reads directions, before wi.

        `latent` (F, latent or latent + bins^2) is from the encoder, `where` and `patch` are from `encode_patch`.
        """
        # What all queries of a fabric share is multiplied once.
        weight, viewer = self.first.weight, wo[..., :2]
        if self.fusion is None:
            x = _without_light(weight[:, self.latent :], patch, viewer)
        else:
            x = functional.linear(patch, weight[:, self.latent :])
        x = x + functional.linear(latent[:, : self.latent], weight[:, : self.latent], self.first.bias).unsqueeze(1)
        if self.filters is not None and where is not None:
            responses = self.filters(latent[:, self.latent :][:, self.seen_cells])
            x = torch.baddbmm(x, where, responses)
        if self.fusion is None:
            return x
        x = activate(x)
        for layer in self.fusion[:-1]:
            x = activate(layer(x))
        return _without_light(self._angular.weight, x, viewer, self._angular.bias)

    def lit(self, seen: Tensor, wi: Tensor) -> Tensor:
        """Answer in network space, (F, n, 4), transparency appended if `transmission` is learnt."""
        x = activate(seen + functional.linear(wi, self._angular.weight[:, _LIGHT]))
        return activate(self.last(activate(self.narrow(self.mix(x)))))

    def layers_of(self, latent: Tensor) -> dict[str, LinearLayer]:
        """Return the layers for a fabric with a latent (1, latent or latent + bins^2), in their order, by name.

        The first reads shares of the picture, if any, and blobs; its bias has what it reads of the latent. A residual
        block is ``mix_first`` and ``mix_second``; ``harmonics`` makes periodic blobs of cosines and sines.
        """
        assert self.fusion is not None
        weight, bins = self.first.weight, self.options.bins
        rows = [weight[:, self.latent :].t()]
        if self.filters is not None:
            rows.insert(0, self.filters(latent[0, self.latent :][self.seen_cells]))
        bias = self.first.bias + weight[:, : self.latent] @ latent[0, : self.latent]
        names = ("fusion", "fused", "angular")[-len(self.fusion) :]
        layers: dict[str, nn.Module] = dict(zip(names, self.fusion, strict=True))
        layers |= {"mix_first": self.mix.first, "mix_second": self.mix.second, "narrow": self.narrow, "last": self.last}
        parts = {"first": (torch.cat(rows), bias)}
        parts |= {name: (own.weight.t(), own.bias) for name, own in layers.items() if isinstance(own, nn.Linear)}
        parts["harmonics"] = harmonic_weights(torch.arange(1.0, bins), bins), torch.full((bins,), 1.0 / bins)
        return {name: LinearLayer(*(values.numpy(force=True) for values in own)) for name, own in parts.items()}

    @property
    def _angular(self) -> nn.Linear:
        """The layer that reads directions."""
        return self.first if self.fusion is None else cast(nn.Linear, self.fusion[-1])


def _without_light(weight: Tensor, x: Tensor, viewer: Tensor, bias: Tensor | None = None) -> Tensor:
    """Return a layer's product with numbers and viewer, without its inputs wi."""
    weight = torch.cat([weight[:, : _LIGHT.start], weight[:, _LIGHT.stop :]], dim=-1)
    return functional.linear(torch.cat([x, viewer], dim=-1), weight, bias)
