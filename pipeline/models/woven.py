"""One network for many woven fabrics at many scales [Chen2024Woven].

An encoder reads a fabric's normal and tangent maps over one repeat, and four parameters, into a latent of 64 numbers;
it runs once a fabric. A decoder reads the latent, the patch P = (u, v, size) as one-blobs, and the directions, and
answers with the four components, the specular ones in log space:

    encoder   maps 6 x side x side -> residual convolutions, padded around the repeat -> 64
              + (alpha, beta) of both yarns -> 128 -> residual -> 64
    fusion    latent 64 + one-blob(P) 24 -> 128 -> 128 -> 64
    angular   + wi xyz + wo xy = 69 -> 128 -> residual -> 64 -> 4

A residual block is two fully connected layers with the skip added before the last activation; a leaky ReLU follows
every layer, the last one too. The paper's figure shows one layer less in the fusion, but its count of 86,660
parameters is met exactly by one more layer 128 -> 128, placed here in the fusion. Not published, so chosen here: the
encoder of the maps (smaller than theirs, to be trained in minutes), the scale of the size, the training on all mirror
images.

OWN CHANGE, `one_blob = "local"`: as published, the decoder has to learn products of latent and place, and learns them
so slowly that small footprints come out as the repeat's average. Here the encoder also gives a picture of the repeat,
8 x 8 numbers, and the first layer sees it from the place asked about: its 128 filters are correlated with the picture
around the repeat, and read at (u, v) through the footprint's own one-blobs. Both are the same for all queries of a
fabric, so that this costs a query one product of 64 x 128 in place of the latent's, which moves into the bias. The 24
one-blobs tell the place within the yarn. The decoder has 8,192 parameters more, the latent 64 numbers.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn
from torch.nn import functional

from pipeline.fingerprint import fingerprint
from pipeline.models.domain import Domain, domain_of
from pipeline.models.encodings import encoded_size, one_blob, periodic_blob
from pipeline.models.losses import to_components, to_network, weighted_error
from pipeline.models.method import Batch, in_chunks, in_repeat
from pipeline.models.options import WovenOptions
from pipeline.models.placement import SYMMETRIES, Placement, moved, placement, standard
from pipeline.truth.query import Queries
from weaves.draft import Matrix
from weaves.errors import BadInput
from weaves.fabric import Fabric
from weaves.surface import surface_at

_SLOPE = 0.01
_DIRECTIONS = 5
_FUSED = 64
_SHARPNESS = 0.4  # deviation of the sharpest blob of `local`, in bins


def _activate(x: Tensor) -> Tensor:
    return functional.leaky_relu(x, _SLOPE)


def _patch(options: WovenOptions) -> int:
    """Return how many numbers say where a footprint lies and how large it is."""
    return 3 if options.one_blob == "none" else 3 * options.bins


def _counts(options: WovenOptions) -> tuple[int, int]:
    """Return how many parameters a fabric has and how many numbers an answer."""
    return (7, 5) if options.transmission else (4, 4)


class _Residual(nn.Module):
    """Two fully connected layers; the skip is added before the last activation."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.first, self.second = nn.Linear(width, width), nn.Linear(width, width)

    def forward(self, x: Tensor) -> Tensor:
        return _activate(x + self.second(_activate(self.first(x))))


class _MapBlock(nn.Module):
    """A residual block of convolutions that halves the map; padding wraps, because the repeat does."""

    def __init__(self, channels_in: int, channels_out: int) -> None:
        super().__init__()
        self.first = nn.Conv2d(channels_in, channels_out, 3, stride=2, padding=1, padding_mode="circular")
        self.second = nn.Conv2d(channels_out, channels_out, 3, padding=1, padding_mode="circular")

    def forward(self, x: Tensor) -> Tensor:
        x = _activate(self.first(x))
        return _activate(x + self.second(x))


class _Encoder(nn.Module):
    """Maps (F, 6, side, side) and parameters (F, 4) to latents (F, latent), a picture appended if it is `local`."""

    def __init__(self, options: WovenOptions) -> None:
        super().__init__()
        channels = [6] + [options.encoder_channels * factor for factor in (1, 2, 4, 4)]
        self.maps = nn.ModuleList(_MapBlock(a, b) for a, b in itertools.pairwise(channels))
        self.local, self.bins = options.one_blob == "local", options.bins
        flat = channels[-1] if self.local else channels[-1] * (options.map_texels // 16) ** 2
        self.flat = nn.Linear(flat, options.latent)
        self.join = nn.Linear(options.latent + _counts(options)[0], options.hidden)
        self.mix = _Residual(options.hidden)
        self.last = nn.Linear(options.hidden, options.latent)
        if self.local:
            # Taken where the maps are as fine as the picture, or the next coarser.
            self.depth = min(max((options.map_texels // options.bins).bit_length() - 1, 1), len(self.maps))
            wide = channels[self.depth]
            convolution = nn.Conv2d(wide, wide, 3, padding=1, padding_mode="circular")
            self.picture = nn.Sequential(convolution, nn.LeakyReLU(_SLOPE), nn.Conv2d(wide, 1, 1))

    def forward(self, maps: Tensor, parameters: Tensor) -> Tensor:
        finer = [maps]
        for block in self.maps:
            finer.append(block(finer[-1]))
        # What lies where is the picture's part, if there is one; the rest is then the same wherever the repeat begins.
        x = finer[-1].mean(dim=(2, 3)) if self.local else finer[-1].flatten(1)
        x = _activate(self.join(torch.cat([_activate(self.flat(x)), parameters], dim=-1)))
        x = _activate(self.last(self.mix(x)))
        if self.local:
            picture = functional.adaptive_avg_pool2d(self.picture(finer[self.depth]), self.bins)
            x = torch.cat([x, _activate(picture.flatten(1))], dim=-1)
        return x


class _Decoder(nn.Module):
    """Latents and patches to network space: 86,660 parameters at the default widths, and 8,192 filters if `local`."""

    def __init__(self, options: WovenOptions) -> None:
        super().__init__()
        hidden, patch = options.hidden, _patch(options)
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
        self.mix = _Residual(hidden)
        self.narrow = nn.Linear(hidden, _FUSED)
        self.last = nn.Linear(_FUSED, _counts(options)[1])

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
        x = _activate(x)
        if self.fusion is not None:
            deeper, narrow, angular = self.fusion
            x = _activate(narrow(_activate(deeper(x))))
            x = _activate(angular(torch.cat([x, directions], dim=-1)))
        x = _activate(self.narrow(self.mix(x)))
        return _activate(self.last(x))


class Cloth(NamedTuple):
    """What the network reads of F fabrics, in standard position.

    Attributes
    ----------
    maps : Tensor (F, 6, side, side)
        Ply normal and fibre tangent at texel centres over one repeat; row = y, column = x.
    parameters : Tensor (F, 4 or 7)
        alpha_warp, alpha_weft, beta_warp, beta_weft; with `transmission` both widths and the optical thickness.
    placement : Placement
        How queries about the fabrics get there.
    """

    maps: Tensor
    parameters: Tensor
    placement: Placement

    def take(self, index: Tensor) -> Cloth:
        """Return the fabrics at `index`."""
        return Cloth(self.maps[index], self.parameters[index], Placement(*(part[index] for part in self.placement)))

    def begun(self, shares: npt.NDArray[np.float64]) -> Cloth:
        """Return the same cloth, each repeat begun elsewhere: `shares` (F, 2) of it to the left and downwards.

        Queries follow exactly, maps to the nearest texel.
        """
        texels = np.rint(shares * self.maps.shape[-1]).astype(np.int64).tolist()
        maps = [
            torch.roll(one, (down, right), dims=(1, 2)) for one, (right, down) in zip(self.maps, texels, strict=True)
        ]
        start = self.placement.start - torch.from_numpy(shares.astype(np.float32)).to(self.maps.device)
        return Cloth(torch.stack(maps), self.parameters, self.placement._replace(start=start))

    def to(self, device: torch.device) -> Cloth:
        """Return the same on a device."""
        parts = (part.to(device) for part in self.placement)
        return Cloth(self.maps.to(device), self.parameters.to(device), Placement(*parts))


def read_cloth(fabrics: Sequence[Fabric], options: WovenOptions, like: Fabric | None = None) -> Cloth:
    """Look at the surfaces of at least one fabric.

    Parameters
    ----------
    fabrics : sequence of Fabric
        At least one.
    options : WovenOptions
        Whether they are brought into standard position, and how finely they are seen.
    like : Fabric, optional
        All are mirrored, exchanged and begun as brings this one into standard position; otherwise each by itself.
    """
    centre = (np.arange(options.map_texels) + 0.5) / options.map_texels
    maps, parameters, placements = [], [], []
    for fabric in fabrics:
        seen, symmetry, start = fabric, SYMMETRIES[0], (0, 0)
        if options.standard:
            seen, symmetry, start = standard(like or fabric)
            seen = seen if like is None else _begun_at(moved(fabric, symmetry), start)
        ends, picks = seen.weave.repeat
        surface = surface_at(seen, centre[None, :] * ends, centre[:, None] * picks)
        maps.append(np.concatenate([surface.normal, surface.tangent], axis=-1).transpose(2, 0, 1))
        numbers = [seen.warp.roughness, seen.weft.roughness, seen.warp.relief, seen.weft.relief]
        more = [seen.warp.width, seen.weft.width, seen.optical_thickness / 2.0]
        parameters.append(numbers + (more if options.transmission else []))
        placements.append(placement(fabric, symmetry, start))
    together = Placement(*(torch.cat(parts) for parts in zip(*placements, strict=True)))
    return Cloth(torch.from_numpy(np.array(maps, np.float32)), torch.tensor(parameters), together)


def _begun_at(fabric: Fabric, start: tuple[int, int]) -> Fabric:
    """Return a fabric whose repeat begins at the end and pick of `start`."""
    end, pick = start
    return fabric.model_copy(update={"draft": Matrix(rows=tuple(fabric.weave.rolled(-end, -pick).rows()))})


class WovenNetwork(nn.Module):
    """Encoder and decoder, with the cloth it is trained on.

    Parameters
    ----------
    options : WovenOptions
        The design.
    fabrics : sequence of Fabric
        Training fabrics, addressed by index in batches; none for inference.
    """

    def __init__(self, options: WovenOptions, fabrics: Sequence[Fabric] = ()) -> None:
        super().__init__()
        self.options = options
        self.encoder, self.decoder = _Encoder(options), _Decoder(options)
        for layer in self.modules():
            if isinstance(layer, nn.Linear | nn.Conv2d) and layer.bias is not None:
                nn.init.kaiming_normal_(layer.weight, a=_SLOPE)
                nn.init.zeros_(layer.bias)
        self._cloth = read_cloth(fabrics, options) if fabrics else None

    def encode(self, cloth: Cloth) -> Tensor:
        """Return the latents (F, latent)."""
        latents: Tensor = self.encoder(cloth.maps, cloth.parameters)
        return latents

    def decode(
        self, latent: Tensor, placement: Placement, u: Tensor, v: Tensor, sigma: Tensor, wi: Tensor, wo: Tensor
    ) -> Tensor:
        """Answer in network space, for fabrics in standard position.

        Parameters
        ----------
        latent : Tensor (F, latent)
            From `encode`.
        placement : Placement
            Of the F fabrics.
        u, v : Tensor (F, n)
            Centres as shares of each fabric's own repeat.
        sigma : Tensor (F, n)
            Footprints, in yarn spacings.
        wi, wo : Tensor (F, n, 3)
            Directions.

        Returns
        -------
        Tensor (F, n, 4 or 5)
            Of the fabric in standard position: `placement.swap` gives the fabric's own components. With `transmission`
            the fifth is the transparency.
        """
        u, v, wi, wo = placement.move(u, v, wi, wo)
        options, bins, extent = self.options, self.options.bins, placement.repeat
        size = sigma / extent.prod(dim=-1, keepdim=True).sqrt()
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
            sharp, places = (_SHARPNESS / bins) ** 2, ((u, extent[:, :1]), (v, extent[:, 1:]))
            column, row = (periodic_blob(x, (sharp + (sigma / period) ** 2).sqrt(), bins) for x, period in places)
            where = (row.unsqueeze(-1) * column.unsqueeze(-2)).flatten(-2)
            spread = (sharp + sigma.square()).sqrt()
            blobs = [bins * periodic_blob(x * period, spread, bins) for x, period in places]
        output: Tensor = self.decoder(latent, where, torch.cat([*blobs, size], dim=-1), wi, wo)
        return output

    def loss(self, batch: Batch, random: np.random.Generator) -> Tensor:
        """Return the weighted squared error in network space."""
        assert self._cloth is not None
        self._cloth = self._cloth.to(batch.u.device)
        cloth, options = self._cloth.take(batch.fabric), self.options
        if options.roll:
            repeat = cloth.placement.repeat.cpu().numpy().astype(np.float64)
            cloth = cloth.begun(random.integers(repeat.astype(np.int64)) / repeat)
        own = cloth.placement.own_repeat()
        u, v = batch.u / own[:, :1], batch.v / own[:, 1:]
        output = self.decode(self.encode(cloth), cloth.placement, u, v, batch.sigma, batch.wi, batch.wo)
        target = to_network(cloth.placement.swap(batch.target), options.log_k)
        error = weighted_error(output[..., :4], target, options.specular_weight, options.diffuse_weight)
        if options.transmission:
            error = error + options.transparency_weight * (output[..., 4] - batch.transparency).square().mean()
        return error

    def start_at(self, target: Tensor) -> None:
        """Set the last bias to the mean target, and the last weights small: a leaky ReLU can stall far from it."""
        with torch.no_grad():
            self.decoder.last.bias[:4].copy_(to_network(target, self.options.log_k).mean(dim=0))
            self.decoder.last.weight.mul_(0.01)

    def schedule(self, progress: float) -> None:
        """Change nothing over the training."""

    def parameter_groups(self, rate: float) -> list[dict[str, Any]]:
        """Return one group: all weights learn at the same rate."""
        return [{"params": list(self.parameters()), "lr": rate}]

    def architecture(self) -> dict[str, Any]:
        """Count parameters and name the layers."""
        counts = {
            part: sum(weight.numel() for weight in module.parameters())
            for part, module in (("encoder", self.encoder), ("decoder", self.decoder))
        }
        layers = {name: list(weight.shape) for name, weight in self.named_parameters()}
        return {"parameters": counts | {"total": sum(counts.values())}, "layers": layers}


class Woven:
    """A trained network that answers for any fabric; it encodes each once.

    Parameters
    ----------
    network : WovenNetwork
        Trained weights.
    domain : Domain, optional
        What it was taught; anything if left out.
    device : torch.device
        Where it computes.
    """

    def __init__(self, network: WovenNetwork, domain: Domain | None = None, device: torch.device | None = None) -> None:
        self.name, self.setting, self.domain = network.options.name, "", domain
        self._device = device or torch.device("cpu")
        self._network = network.eval().to(self._device)
        self._encoded: dict[str, tuple[Tensor, Placement]] = {}

    def covers(self, fabric: Fabric) -> bool:
        """Say yes: any fabric can be encoded."""
        return True

    def prepare(self, fabric: Fabric) -> None:
        """Encode the fabric, once."""
        self._encode(fabric)

    def predict(self, fabric: Fabric, queries: Queries, seed: int = 0) -> npt.NDArray[np.float32]:
        """Answer N queries, float32 (N, 4); `seed` is not used. BadInput for kinds of queries it was not taught."""
        return self._components(queries, *self._encode(fabric))

    def predict_between(self, first: Fabric, second: Fabric, share: float, queries: Queries) -> npt.NDArray[np.float32]:
        """Answer for what lies between two fabrics: latents are blended, nothing between them is encoded.

        Parameters
        ----------
        first, second : Fabric
            Of one repeat. Both are placed as the first one is: what is blended must lie in the same place.
        share : float
            Of the second one's latent; 0 is the first fabric, 1 the second.
        queries : Queries
            N questions, in yarn spacings of either fabric.

        Returns
        -------
        float32 (N, 4)

        Raises
        ------
        BadInput
            If the repeats differ, or for kinds of queries that were not taught.
        """
        if first.weave.repeat != second.weave.repeat:
            (ends, picks), allowed = second.weave.repeat, "the repeat of {} is needed, {} x {}, to blend the two"
            raise BadInput(second.name, "repeat", f"{ends} x {picks}", allowed.format(first.name, *first.weave.repeat))
        with torch.inference_mode():
            cloth = read_cloth([first, second], self._network.options, like=first).to(self._device)
            one, other = self._network.encode(cloth)
            blended = torch.lerp(one, other, share).unsqueeze(0)
            place = cloth.take(torch.tensor([0], device=self._device)).placement
        return self._components(queries, blended, place)

    def transparency(self, fabric: Fabric, queries: Queries) -> npt.NDArray[np.float32]:
        """Return the share of light from straight behind that passes unscattered, float32 (N,) in [0, 1].

        0 if `transmission` was not learnt.
        """
        if not self._network.options.transmission:
            return np.zeros(len(queries.u), np.float32)

        def read(output: Tensor) -> Tensor:
            return output[0, :, 4:].clamp(0.0, 1.0).expand(-1, 4)

        return self._answer(queries, *self._encode(fabric), read)[:, 0].copy()

    def _components(self, queries: Queries, latent: Tensor, place: Placement) -> npt.NDArray[np.float32]:
        log_k = self._network.options.log_k
        return self._answer(queries, latent, place, lambda output: to_components(place.swap(output[..., :4])[0], log_k))

    def _answer(
        self, queries: Queries, latent: Tensor, place: Placement, read: Callable[[Tensor], Tensor]
    ) -> npt.NDArray[np.float32]:
        if self.domain is not None:
            self.domain.refuse(queries, self.name)

        def answer(*columns: Tensor) -> Tensor:
            return read(self._network.decode(latent, place, *(column.unsqueeze(0) for column in columns)))

        ends, picks = place.own_repeat()[0].tolist()
        return in_chunks(in_repeat(queries, (int(ends), int(picks))), answer, self._device)

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the bytes of the decoder and of the fabric's latent; the encoder is not needed to render."""
        latent, _ = self._encode(fabric)
        return 4 * (sum(weight.numel() for weight in self._network.decoder.parameters()) + latent.numel())

    def _encode(self, fabric: Fabric) -> tuple[Tensor, Placement]:
        key = fingerprint(fabric.optics())
        if key not in self._encoded:
            with torch.inference_mode():
                cloth = read_cloth([fabric], self._network.options).to(self._device)
                self._encoded[key] = self._network.encode(cloth), cloth.placement
        return self._encoded[key]


def build(options: WovenOptions, fabrics: Sequence[Fabric]) -> WovenNetwork:
    """Return an untrained network for these fabrics."""
    return WovenNetwork(options, fabrics)


def restore(options: WovenOptions, trained: Sequence[tuple[dict[str, Any], dict[str, Tensor]]]) -> list[Woven]:
    """Return the method that a trained network is."""
    methods = []
    for card, weights in trained:
        network = WovenNetwork(options)
        network.load_state_dict(weights)
        methods.append(Woven(network, domain_of(card)))
    return methods
