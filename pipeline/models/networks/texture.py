"""Neural textures over one repeat: pyramids of features that wrap, read bilinearly, and blurred early in a training.

Level 0 is the finest; each following one is half as fine. A footprint sigma reads between the two levels around
log2(sigma / sigma_0), sigma_0 = half a finest texel, with linear weights. The blur is a Gaussian around the repeat, and
is annealed, so that coarse structure is learnt first [Kuznetsov2021NeuMIP]. Textures learn faster than perceptrons,
because a short training touches each texel rarely. The offset texture is held fixed after a share of the training.
"""

import math
from collections.abc import Sequence
from typing import Any, ClassVar, Final, cast

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from pipeline.compiled.arrays import Float32
from pipeline.models.network import QueryNetwork
from pipeline.models.networks.layers import perceptron, start_at_mean
from pipeline.models.options import TextureOptions

_FEATURE_SCALE = 0.1  # standard deviation of the first features
_NO_BLUR = 0.25  # standard deviation, in texels, below which a blur is skipped
DEPTH_SCALE: Final = 0.1  # shift of a learnt depth of 1, in mean sides of the repeat
STEEPEST: Final = 0.6  # smallest wo.z that parallax is computed with
LAYERS: Final = 3  # hidden layers of all perceptrons


def level_shapes(texels_per_yarn: int, levels: int, repeat: tuple[int, int]) -> list[tuple[int, int]]:
    """Return (rows, columns) of levels, finest first, each half as fine; `levels` 0: down to one texel."""
    columns, rows = (extent * texels_per_yarn for extent in repeat)
    shapes = [(rows, columns)]
    while shapes[-1] != (1, 1) and len(shapes) != levels:
        shapes.append((math.ceil(shapes[-1][0] / 2), math.ceil(shapes[-1][1] / 2)))
    return shapes


def random_pyramid(channels: int, shapes: Sequence[tuple[int, int]]) -> nn.ParameterList:
    """Return random textures of these shapes to learn from."""
    return nn.ParameterList(nn.Parameter(_FEATURE_SCALE * torch.randn(channels, *shape)) for shape in shapes)


def blurred(texture: Tensor, deviation: float) -> Tensor:
    """Blur a texture (channels, rows, columns) around the repeat, exactly, in the frequency domain.

    `deviation` is the Gaussian's, in texels; below a quarter nothing is done.
    """
    if deviation < _NO_BLUR or texture.shape[-2:].numel() == 1:
        return texture
    rows, columns = texture.shape[-2:]
    spectrum = torch.fft.rfft2(texture)
    along = torch.fft.fftfreq(rows, device=texture.device).square().unsqueeze(-1)
    frequency = along + torch.fft.rfftfreq(columns, device=texture.device).square()
    decay = torch.exp(-2.0 * math.pi**2 * deviation**2 * frequency)
    smooth: Tensor = torch.fft.irfft2(spectrum * decay, s=(rows, columns))
    return smooth


def read_pyramid(
    levels: Sequence[Tensor], u: Tensor, v: Tensor, sigma: Tensor, texels_per_yarn: int, blur: float = 0.0
) -> Tensor:
    """Read a pyramid at footprints: (n, channels).

    Levels (channels, rows, columns) come finest first, with `texels_per_yarn` along one yarn spacing in the finest. u
    and v (n,) are in repeats, sigma (n,) in yarn spacings; `blur` is a standard deviation in finest texels.
    """
    level = torch.log2(sigma / (0.5 / texels_per_yarn)).clamp(0.0, len(levels) - 1.0)
    below = level.floor().clamp_max(max(len(levels) - 2, 0))
    share = (level - below).unsqueeze(-1)
    low = below.to(torch.int64)
    textures = [blurred(texture, blur / 2**index) for index, texture in enumerate(levels)]
    if len(textures) == 1:
        return read_texture(textures, u, v, [low])
    return read_texture(textures, u, v, [low, low + 1], [1.0 - share[:, 0], share[:, 0]])


def read_texture(
    textures: list[Tensor], u: Tensor, v: Tensor, levels: list[Tensor], shares: list[Tensor] | None = None
) -> Tensor:
    """Read wrapped textures bilinearly and blend levels: (n, channels).

    Textures (channels, rows, columns) lie over one repeat; texel (r, c) has its centre at v = (r + 1/2)/rows, u = (c +
    1/2)/columns. u and v (n,) are in repeats, any real numbers. `levels` are int64 (n,), textures to read for each
    query; `shares` the weight of each, 1 if left out.
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
    texels, share = torch.stack(indices, -1), torch.stack(weights, -1)
    if torch.compiler.is_exporting():  # other runtimes would loop over the bags
        return (table[texels] * share.unsqueeze(-1)).sum(dim=-2)
    return functional.embedding_bag(texels, table, per_sample_weights=share, mode="sum")


def texels_of(texture: Tensor) -> Float32:
    """Return a texture (channels, rows, columns) texel by texel, (rows, columns, channels)."""
    return np.ascontiguousarray(texture.numpy(force=True).transpose(1, 2, 0))


class TextureNetwork(QueryNetwork):
    """Textures of one fabric, with a repeat of so many ends and picks, and perceptrons that read them."""

    textures: ClassVar[tuple[str, ...]]  # names of those parts that are textures
    options: TextureOptions
    levels: nn.ParameterList  # pyramid of features, finest first
    decoder: nn.Sequential  # puts out the four components in network space
    depth: nn.Parameter | None  # the offset texture
    offset: nn.Sequential | None  # perceptron from the offset texture and the view to the depth

    def __init__(self, options: TextureOptions, repeat: tuple[int, int]) -> None:
        super().__init__()
        self.options, self.repeat = options, repeat
        self._blur = 0.0  # standard deviation, in finest texels

    def create_reflectance(self, view: int, light: int) -> None:
        """Create levels, decoder, depth and offset, for perceptrons that read so many numbers of view and light."""
        options, channels = self.options, self.options.channels
        shapes = level_shapes(options.texels_per_yarn, options.levels, self.repeat)
        self.levels = random_pyramid(channels, shapes)
        self.decoder = perceptron(channels + view + light, options.hidden, LAYERS, 4)
        self.depth = self.offset = None
        if options.offset:
            self.depth = nn.Parameter(torch.zeros(channels, *shapes[0]))
            self.offset = perceptron(channels + view, options.hidden, LAYERS, 1)

    def start_at(self, target: Tensor) -> None:
        """Set the last bias to the mean target."""
        start_at_mean(cast(nn.Linear, self.decoder[-1]), target, self.options.log_k)

    def schedule(self, progress: float) -> None:
        """Halve the blur again and again, and freeze the offset texture, at `progress` in [0, 1)."""
        options = self.options
        self._blur = options.blur * 2.0 ** (-progress / options.blur_halving)
        if self.depth is not None:
            self.depth.requires_grad_(progress < options.offset_frozen)

    def parameter_groups(self, rate: float) -> list[dict[str, Any]]:
        """Return two groups: perceptrons at `rate`, textures faster."""
        perceptrons, textures = self._parts()
        return [{"params": perceptrons, "lr": rate}, {"params": textures, "lr": rate * self.options.texture_rate}]

    def counts(self) -> dict[str, int]:
        """Return the numbers of parameters of perceptrons and textures."""
        perceptrons, textures = (sum(weight.numel() for weight in part) for part in self._parts())
        return {"textures": textures, "perceptrons": perceptrons}

    def read(self, levels: Sequence[Tensor], u: Tensor, v: Tensor, sigma: Tensor, texels: int = 0) -> Tensor:
        """Read a pyramid as `read_pyramid`, blurred in training; `texels` a yarn, as in the options if left out."""
        finest = self.options.texels_per_yarn
        texels = texels or finest
        blur = self._blur * (texels / finest) if self.training else 0.0
        return read_pyramid(levels, u, v, sigma, texels, blur)

    def moved(self, u: Tensor, v: Tensor, sigma: Tensor, wo: Tensor, seen: Tensor) -> tuple[Tensor, Tensor]:
        """Return centres u, v (n,), in repeats, shifted along the view by the learnt depth, as parallax does.

        The shift is 0.1 depth wo.xy / max(wo.z, 0.6), in mean sides of the repeat; `seen` are the perceptron's inputs
        for the viewer. Without an offset texture nothing is shifted.
        """
        if self.offset is None or self.depth is None:
            return u, v
        here = self.read([self.depth], u, v, sigma)
        depth = self.offset(torch.cat([here, seen], dim=-1))
        shift = DEPTH_SCALE * depth * wo[:, :2] / wo[:, 2:].clamp_min(STEEPEST)
        ends, picks = self.repeat
        side = math.sqrt(ends * picks)
        return u + shift[:, 0] * (side / ends), v + shift[:, 1] * (side / picks)

    def _parts(self) -> tuple[list[nn.Parameter], list[nn.Parameter]]:
        """Return the parameters of perceptrons and of textures."""
        named = [(name.split(".")[0] in self.textures, weight) for name, weight in self.named_parameters()]
        return [weight for texture, weight in named if not texture], [weight for texture, weight in named if texture]
