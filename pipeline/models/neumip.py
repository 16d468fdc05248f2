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
from pipeline.models.losses import to_components, to_network, weighted_error
from pipeline.models.method import Batch, in_chunks, in_repeat
from pipeline.models.options import NeumipOptions
from pipeline.truth.query import Queries
from weaves.fabric import Fabric

_FEATURE_SCALE = 0.1  # standard deviation of the first features
_DEPTH_SCALE = 0.1
_STEEPEST = 0.6  # smallest wo.z that parallax is computed with
_NO_BLUR = 0.25  # standard deviation, in texels, below which a blur is skipped


class _Perceptron(nn.Sequential):
    """Three hidden layers of ReLU."""

    def __init__(self, inputs: int, hidden: int, outputs: int) -> None:
        widths = [inputs, hidden, hidden, hidden]
        layers: list[nn.Module] = []
        for a, b in itertools.pairwise(widths):
            layers += [nn.Linear(a, b), nn.ReLU()]
        super().__init__(*layers, nn.Linear(hidden, outputs))
        for layer in self:
            if isinstance(layer, nn.Linear):
                nn.init.kaiming_normal_(layer.weight)
                nn.init.zeros_(layer.bias)


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
        self.shapes = level_shapes(options, repeat)  # (rows, columns), finest first
        self.levels = nn.ParameterList(
            nn.Parameter(_FEATURE_SCALE * torch.randn(options.channels, *shape)) for shape in self.shapes
        )
        self.decoder = _Perceptron(options.channels + 4, options.hidden, 4)
        self.depth: nn.Parameter | None = None
        self.offset: _Perceptron | None = None
        if options.offset:
            self.depth = nn.Parameter(torch.zeros(options.channels, *self.shapes[0]))
            self.offset = _Perceptron(options.channels + 2, options.hidden, 1)
        self._blur = 0.0  # standard deviation, in finest texels

    def forward(self, u: Tensor, v: Tensor, sigma: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        """Answer in network space, (n, 4); u, v (n,) are shares of the repeat, sigma is in yarn spacings."""
        if self.offset is not None and self.depth is not None:
            here = read_texture([self._blurred(self.depth, 0)], u, v, [torch.zeros_like(u, dtype=torch.int64)])
            depth = _DEPTH_SCALE * self.offset(torch.cat([here, wo[:, :2]], dim=-1))
            shift = depth * wo[:, :2] / wo[:, 2:].clamp_min(_STEEPEST)
            ends, picks = self.repeat
            side = math.sqrt(ends * picks)
            u, v = u + shift[:, 0] * (side / ends), v + shift[:, 1] * (side / picks)
        features = self._read_pyramid(u, v, sigma)
        output: Tensor = self.decoder(torch.cat([features, wi[:, :2], wo[:, :2]], dim=-1))
        return output

    def loss(self, batch: Batch, random: np.random.Generator) -> Tensor:
        """Return the weighted squared error in network space."""
        options = self.options
        ends, picks = self.repeat
        flat = [column.flatten(0, 1) for column in (batch.u / ends, batch.v / picks, batch.sigma, batch.wi, batch.wo)]
        target = to_network(batch.target.flatten(0, 1), options.log_k)
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
        finest = 0.5 / self.options.texels_per_yarn
        level = torch.log2(sigma / finest).clamp(0.0, len(self.shapes) - 1.0)
        below = level.floor().clamp_max(max(len(self.shapes) - 2, 0))
        share = (level - below).unsqueeze(-1)
        low = below.to(torch.int64)
        textures = [self._blurred(texture, index) for index, texture in enumerate(self.levels)]
        if len(textures) == 1:
            return read_texture(textures, u, v, [low])
        return read_texture(textures, u, v, [low, low + 1], [1.0 - share[:, 0], share[:, 0]])

    def _blurred(self, texture: Tensor, level: int) -> Tensor:
        """Blur around the repeat with a Gaussian, exactly, in the frequency domain."""
        deviation = self._blur / 2**level
        if not self.training or deviation < _NO_BLUR or texture.shape[-2:].numel() == 1:
            return texture
        rows, columns = texture.shape[-2:]
        spectrum = torch.fft.rfft2(texture)
        frequency = (
            torch.fft.fftfreq(rows, device=texture.device).square().unsqueeze(-1)
            + torch.fft.rfftfreq(columns, device=texture.device).square()
        )
        decay = torch.exp(-2.0 * math.pi**2 * deviation**2 * frequency)
        blurred: Tensor = torch.fft.irfft2(spectrum * decay, s=(rows, columns))
        return blurred


def level_shapes(options: NeumipOptions, repeat: tuple[int, int]) -> list[tuple[int, int]]:
    """Return (rows, columns) of each level over a repeat (ends, picks), finest first, each half as fine, at least 1."""
    columns, rows = (extent * options.texels_per_yarn for extent in repeat)
    shapes = [(rows, columns)]
    while shapes[-1] != (1, 1) and len(shapes) != options.levels:
        shapes.append((math.ceil(shapes[-1][0] / 2), math.ceil(shapes[-1][1] / 2)))
    return shapes


def read_texture(
    textures: list[Tensor], u: Tensor, v: Tensor, levels: list[Tensor], shares: list[Tensor] | None = None
) -> Tensor:
    """Read wrapped textures bilinearly and blend levels.

    Parameters
    ----------
    textures : list of Tensor (channels, rows, columns)
        Textures over one repeat; texel (r, c) has its centre at v = (r + 1/2)/rows, u = (c + 1/2)/columns.
    u, v : Tensor (n,)
        Where to read, in repeats; any real number.
    levels : list of int64 Tensor (n,)
        Textures to read for each query.
    shares : list of Tensor (n,), optional
        Weight of each entry of `levels`; 1 if left out.

    Returns
    -------
    Tensor (n, channels)
    """
    table = torch.cat([texture.flatten(1) for texture in textures], dim=1).t().contiguous()
    rows, columns = (torch.tensor([t.shape[axis] for t in textures], device=u.device) for axis in (-2, -1))
    start = functional.pad((rows * columns).cumsum(0), (1, 0))[:-1]
    indices, weights = [], []
    for position, level in enumerate(levels):
        height, width, first = rows[level], columns[level], start[level]
        x, y = u * width - 0.5, v * height - 0.5
        left, low = x.floor(), y.floor()
        right_share, up_share = x - left, y - low
        column, row = left.to(torch.int64), low.to(torch.int64)
        share = 1.0 if shares is None else shares[position]
        for dy, weight_y in ((0, 1.0 - up_share), (1, up_share)):
            of_row = first + torch.remainder(row + dy, height) * width
            for dx, weight_x in ((0, 1.0 - right_share), (1, right_share)):
                indices.append(of_row + torch.remainder(column + dx, width))
                weights.append(weight_x * weight_y * share)
    return functional.embedding_bag(
        torch.stack(indices, -1), table, per_sample_weights=torch.stack(weights, -1), mode="sum"
    )


class Neumip:
    """Trained textures, one network for each fabric.

    Parameters
    ----------
    name : str
        Name of the method.
    networks : dict
        From the fingerprint of a fabric's optics to its network.
    device : torch.device
        Where they compute.
    """

    def __init__(self, name: str, networks: dict[str, NeumipNetwork], device: torch.device | None = None) -> None:
        self.name, self.setting = name, ""
        self._device = device or torch.device("cpu")
        self._networks = {key: network.eval().to(self._device) for key, network in networks.items()}

    def covers(self, fabric: Fabric) -> bool:
        """Tell whether this fabric was trained."""
        return fingerprint(fabric.optics()) in self._networks

    def prepare(self, fabric: Fabric) -> None:
        """Do nothing: the textures are in memory."""

    def predict(self, fabric: Fabric, queries: Queries, seed: int = 0) -> npt.NDArray[np.float32]:
        """Answer N queries, float32 (N, 4); `seed` is not used."""
        network = self._networks[fingerprint(fabric.optics())]

        def answer(*columns: Tensor) -> Tensor:
            return to_components(network(*columns), network.options.log_k)

        return in_chunks(in_repeat(queries, fabric.weave.repeat), answer, self._device)

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the bytes of textures and perceptrons, float32."""
        return 4 * sum(weight.numel() for weight in self._networks[fingerprint(fabric.optics())].parameters())


def build(options: NeumipOptions, fabrics: Sequence[Fabric]) -> NeumipNetwork:
    """Return an untrained network; there must be exactly one fabric."""
    (fabric,) = fabrics
    return NeumipNetwork(options, fabric.weave.repeat)


def restore(options: NeumipOptions, trained: Sequence[tuple[dict[str, Any], dict[str, Tensor]]]) -> list[Neumip]:
    """Return one method that holds all trained fabrics."""
    networks = {}
    for card, weights in trained:
        (fabric,) = card["fabrics"]
        ends, picks = fabric["repeat"]
        networks[fabric["optics"]] = NeumipNetwork(options, (ends, picks))
        networks[fabric["optics"]].load_state_dict(weights)
    return [Neumip(options.name, networks)]
