"""One network for many woven fabrics at many scales [Chen2024Woven].

An encoder reads a fabric's normal and tangent maps over one repeat, and four parameters, into a latent of 64 numbers;
it runs once a fabric. A decoder reads the latent, the patch P = (u, v, size) as one-blobs, and the directions, and
answers with the four components, the specular ones in log space:

    encoder   maps 6 x 64 x 64 -> residual convolutions, padded around the repeat -> 64
              + (alpha, beta) of both yarns -> 128 -> residual -> 64
    fusion    latent 64 + one-blob(P) 24 -> 128 -> 128 -> 64
    angular   + wi xyz + wo xy = 69 -> 128 -> residual -> 64 -> 4

A residual block is two fully connected layers with the skip added before the last activation; a leaky ReLU follows
every layer, the last one too. The paper's figure shows one layer less in the fusion, but its count of 86,660
parameters is met exactly by one more layer 128 -> 128, placed here in the fusion. Own choices, for want of published
ones: all of the encoder's maps part, the size's scale, and the training trick `roll` (see WovenOptions).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn
from torch.nn import functional

from pipeline.fingerprint import fingerprint
from pipeline.models.encodings import encoded_size, one_blob
from pipeline.models.losses import to_components, to_network, weighted_error
from pipeline.models.method import Batch, in_chunks, in_repeat
from pipeline.models.options import WovenOptions
from pipeline.truth.query import Queries
from weaves.fabric import Fabric
from weaves.surface import surface_at

_SLOPE = 0.01
_PARAMETERS = 4
_DIRECTIONS = 5


def _activate(x: Tensor) -> Tensor:
    return functional.leaky_relu(x, _SLOPE)


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
    """Maps (F, 6, side, side) and parameters (F, 4) to latents (F, latent)."""

    def __init__(self, options: WovenOptions) -> None:
        super().__init__()
        channels = [6] + [options.encoder_channels * factor for factor in (1, 2, 4, 4)]
        self.maps = nn.Sequential(*(_MapBlock(a, b) for a, b in itertools.pairwise(channels)))
        flat = channels[-1] * (options.map_texels // 16) ** 2
        self.flat = nn.Linear(flat, options.latent)
        self.join = nn.Linear(options.latent + _PARAMETERS, options.hidden)
        self.mix = _Residual(options.hidden)
        self.last = nn.Linear(options.hidden, options.latent)

    def forward(self, maps: Tensor, parameters: Tensor) -> Tensor:
        x = _activate(self.flat(self.maps(maps).flatten(1)))
        x = self.mix(_activate(self.join(torch.cat([x, parameters], dim=-1))))
        return _activate(self.last(x))


class _Decoder(nn.Module):
    """Latents (F, latent), one-blobs (F, n, 3 bins), wi and wo (F, n, 3) to network space (F, n, 4)."""

    def __init__(self, options: WovenOptions) -> None:
        super().__init__()
        hidden, blobs = options.hidden, 3 * options.bins
        self.fused = options.spatial_fusion
        self.latent = options.latent
        first_in = options.latent + blobs + (0 if self.fused else _DIRECTIONS)
        self.first = nn.Linear(first_in, hidden)
        self.fusion = (
            nn.ModuleList([nn.Linear(hidden, hidden), nn.Linear(hidden, 64), nn.Linear(64 + _DIRECTIONS, hidden)])
            if self.fused
            else nn.ModuleList()
        )
        self.mix = _Residual(hidden)
        self.narrow = nn.Linear(hidden, 64)
        self.last = nn.Linear(64, 4)

    def forward(self, latent: Tensor, blobs: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        directions = torch.cat([wi, wo[..., :2]], dim=-1)
        patch = blobs if self.fused else torch.cat([blobs, directions], dim=-1)
        # The latent is the same for all queries of a fabric: its part of the first layer is computed once.
        of_fabric = functional.linear(latent, self.first.weight[:, : self.latent], self.first.bias)
        x = _activate(functional.linear(patch, self.first.weight[:, self.latent :]) + of_fabric.unsqueeze(1))
        if self.fused:
            deeper, narrow, angular = self.fusion
            x = _activate(narrow(_activate(deeper(x))))
            x = _activate(angular(torch.cat([x, directions], dim=-1)))
        x = _activate(self.narrow(self.mix(x)))
        return _activate(self.last(x))


class WovenNetwork(nn.Module):
    """Encoder and decoder, with the maps of the fabrics it is trained on.

    Parameters
    ----------
    options : WovenOptions
        The design.
    fabrics : sequence of Fabric
        Training fabrics, addressed by index in batches; empty for inference.
    """

    def __init__(self, options: WovenOptions, fabrics: Sequence[Fabric] = ()) -> None:
        super().__init__()
        self.options = options
        self.encoder, self.decoder = _Encoder(options), _Decoder(options)
        for layer in self.modules():
            if isinstance(layer, nn.Linear | nn.Conv2d) and layer.bias is not None:
                nn.init.kaiming_normal_(layer.weight, a=_SLOPE)
                nn.init.zeros_(layer.bias)
        inputs = [encoder_inputs(fabric, options.map_texels) for fabric in fabrics]
        maps = np.stack([maps for maps, _ in inputs]) if inputs else np.zeros((0, 6, 1, 1), np.float32)
        parameters = np.stack([row for _, row in inputs]) if inputs else np.zeros((0, _PARAMETERS), np.float32)
        repeats = np.array([fabric.weave.repeat for fabric in fabrics], np.float32).reshape(-1, 2)
        for name, array in (("maps", maps), ("parameters_of", parameters), ("repeats", repeats)):
            self.register_buffer(name, torch.from_numpy(array), persistent=False)
        self.maps: Tensor
        self.parameters_of: Tensor
        self.repeats: Tensor

    def encode(self, maps: Tensor, parameters: Tensor) -> Tensor:
        """Return the latents (F, latent) of maps (F, 6, side, side) and parameters (F, 4)."""
        latents: Tensor = self.encoder(maps, parameters)
        return latents

    def decode(self, latent: Tensor, u: Tensor, v: Tensor, size: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        """Answer in network space (F, n, 4); u, v, size (F, n) are shares of the repeat."""
        options = self.options
        size = encoded_size(size, options.smallest_size, options.largest_size)
        periodic = options.one_blob == "periodic"
        blobs = [one_blob(x, options.bins, wraps) for x, wraps in ((u, periodic), (v, periodic), (size, False))]
        output: Tensor = self.decoder(latent, torch.cat(blobs, dim=-1), wi, wo)
        return output

    def loss(self, batch: Batch, random: np.random.Generator) -> Tensor:
        """Return the weighted squared error in network space."""
        options = self.options
        maps, repeats = self.maps[batch.fabric], self.repeats[batch.fabric]
        u, v = batch.u / repeats[:, :1], batch.v / repeats[:, 1:]
        if options.roll:
            side = maps.shape[-1]
            shifts = random.integers(side, size=(len(maps), 2))
            maps = rolled(maps, shifts)
            turn = torch.from_numpy(shifts.astype(np.float32) / side).to(u.device)
            u, v = u + turn[:, :1], v + turn[:, 1:]
        latent = self.encode(maps, self.parameters_of[batch.fabric])
        size = batch.sigma / repeats.prod(dim=-1, keepdim=True).sqrt()
        output = self.decode(latent, u - u.floor(), v - v.floor(), size, batch.wi, batch.wo)
        target = to_network(batch.target, options.log_k)
        return weighted_error(output, target, options.specular_weight, options.diffuse_weight)

    def start_at(self, target: Tensor) -> None:
        """Set the last bias to the mean target, and the last weights small: a leaky ReLU can stall far from it."""
        with torch.no_grad():
            self.decoder.last.bias.copy_(to_network(target, self.options.log_k).mean(dim=0))
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


def encoder_inputs(fabric: Fabric, texels: int) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """Return what the encoder reads of a fabric.

    Returns
    -------
    maps : float32 (6, texels, texels)
        Ply normal and fibre tangent at texel centres over one repeat; row = y, column = x.
    parameters : float32 (4,)
        alpha_warp, alpha_weft, beta_warp, beta_weft.
    """
    ends, picks = fabric.weave.repeat
    centre = (np.arange(texels) + 0.5) / texels
    x, y = np.meshgrid(centre * ends, centre * picks)
    surface = surface_at(fabric, x, y)
    maps = np.concatenate([surface.normal, surface.tangent], axis=-1).transpose(2, 0, 1)
    warp, weft = fabric.warp, fabric.weft
    parameters = [warp.roughness, weft.roughness, warp.relief, weft.relief]
    return np.ascontiguousarray(maps, np.float32), np.array(parameters, np.float32)


def rolled(maps: Tensor, shifts: npt.NDArray[np.int64]) -> Tensor:
    """Roll each map (F, C, rows, columns) by its own (columns, rows), towards larger x and y."""
    pairs = zip(maps, shifts, strict=True)
    return torch.stack([torch.roll(one, (int(down), int(right)), dims=(1, 2)) for one, (right, down) in pairs])


class Woven:
    """A trained network that answers for any fabric; it encodes each once.

    Parameters
    ----------
    network : WovenNetwork
        Trained weights.
    device : torch.device
        Where it computes.
    """

    def __init__(self, network: WovenNetwork, device: torch.device | None = None) -> None:
        self.name, self.setting = network.options.name, ""
        self._device = device or torch.device("cpu")
        self._network = network.eval().to(self._device)
        self._latents: dict[str, Tensor] = {}

    def covers(self, fabric: Fabric) -> bool:
        """Say yes: any fabric can be encoded."""
        return True

    def prepare(self, fabric: Fabric) -> None:
        """Encode the fabric, once."""
        self._latent(fabric)

    def predict(self, fabric: Fabric, queries: Queries, seed: int = 0) -> npt.NDArray[np.float32]:
        """Answer N queries, float32 (N, 4); `seed` is not used."""
        latent, network = self._latent(fabric), self._network
        side = math.sqrt(math.prod(fabric.weave.repeat))

        def answer(u: Tensor, v: Tensor, sigma: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
            output = network.decode(latent, *(column.unsqueeze(0) for column in (u, v, sigma / side, wi, wo)))
            return to_components(output[0], network.options.log_k)

        return in_chunks(in_repeat(queries, fabric.weave.repeat), answer, self._device)

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the bytes of the decoder and of the fabric's latent; the encoder is not needed to render."""
        return 4 * (sum(weight.numel() for weight in self._network.decoder.parameters()) + self._network.options.latent)

    def _latent(self, fabric: Fabric) -> Tensor:
        key = fingerprint(fabric.optics())
        if key not in self._latents:
            maps, parameters = encoder_inputs(fabric, self._network.options.map_texels)
            with torch.inference_mode():
                inputs = (torch.from_numpy(array).unsqueeze(0).to(self._device) for array in (maps, parameters))
                self._latents[key] = self._network.encode(*inputs)
        return self._latents[key]


def build(options: WovenOptions, fabrics: Sequence[Fabric]) -> WovenNetwork:
    """Return an untrained network for these fabrics."""
    return WovenNetwork(options, fabrics)


def restore(options: WovenOptions, trained: Sequence[tuple[dict[str, Any], dict[str, Tensor]]]) -> list[Woven]:
    """Return the method that a trained network is."""
    methods = []
    for _, weights in trained:
        network = WovenNetwork(options)
        network.load_state_dict(weights)
        methods.append(Woven(network))
    return methods
