"""One encoding of bidirectional textures for all fabrics [Rainer2020Unified].

A texel is known by n angular samples, any n, in any order. An encoder takes them to a latent of 32 numbers, which
means the same for every material; a decoder answers for any directions. A fabric that was never seen is added by one
forward pass, without any optimisation:

    encoder   angles 4 -> 64 -> 64 -> m weights a sample; weights times sample, averaged over n -> 4 m -> 32, ReLU
    decoder   latent 32 + angles 4 -> 106 -> 106 -> 106 -> 106 -> 4

Latents can be averaged, so that a footprint is read from a MIP pyramid of averaged latents: bilinear within a level,
linear between the two levels around log2(sigma / sigma_0), sigma_0 the footprint of a texel. Training and inference
read the same pyramid. In training all texels of a step's fabrics are encoded, each fabric from a random number of its
samples in random order, and the rows of the data set are the targets.

ADAPTED: values are the four components of unit colour in place of RGB, in and out, the specular ones in log space, so
that every model is measured alike. With 3 outputs, `head = "rgb"`, the decoder has the published 38,269 weights
(`RgbBtfNetwork`); then measured samples can be encoded (pipeline.models.unified_btf.encode). Unknown to us, so
chosen here: m, the widths of the encoder, the activations, the loss, the parameterisation of directions. Reflection
only, as published.

A training reads the samples of its fabrics from shards. A fabric that is added to a trained model brings its samples
with it, as in the paper: computing them is part of the method, and of the time that adding a fabric takes.

`universal` has this decoder and no encoder: latents are learnt with the decoder, from rows and samples
[Park2019DeepSDF]. Those of a fabric that is added fit its samples, and means of its samples at all levels of
the pyramid, by descent from 0; the decoder stays as it is.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final
from weakref import WeakValueDictionary

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn
from torch.nn import functional

from pipeline.compiled.arrays import Float32, Index
from pipeline.fingerprint import fingerprint
from pipeline.models.network import Batch, NetworkMethod, Trained, restored
from pipeline.models.networks.layers import (
    EncoderDecoder,
    component_error,
    once_a_place,
    perceptron,
    start_at_mean,
    to_components,
)
from pipeline.models.networks.texture import level_shapes, read_pyramid
from pipeline.models.unified_btf import BtfOptions, EncoderOptions, UniversalOptions
from pipeline.models.unified_btf.measured import MEASURED, MeasuredCloth
from pipeline.shards.queries import QueryOptions
from pipeline.truth.conventions import COMPONENTS
from weaves.errors import BadInput
from weaves.fabric import Fabric

LATENTS: Final = "latents"  # weights of a material of measured samples: those of its texels, (rows, columns, latent)
_DIRECTION_NUMBERS = 4  # that a pair of directions is given as
_ROWS = 65_536  # rows that are encoded at a time
_PAINTED = 0.5  # share of the entries of random colours that are not 0, so that pure components are among them
# Two sets of colours, (components, RGB), that show a network of RGB the four components: three of them, and the last.
_PAINTS: Final = (((1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, 0)), ((0, 0, 0), (0, 0, 0), (0, 0, 0), (1, 1, 1)))
_ENCODER_LAYERS, _DECODER_LAYERS = 2, 4  # hidden ones; those of the encoder come before the weights


@dataclass(frozen=True, eq=False)
class Texels:
    """T texels of one repeat, each seen under the same n pairs of directions: inputs of the encoder."""

    shape: tuple[int, int]  # rows and columns of texels; texel t lies in row t // columns, column t % columns
    angles: Tensor  # directions (`angles_of`), float32 Tensor (n, 4)
    values: Tensor  # components; their own noise is far above the rounding, float16 Tensor (n, T, 4)

    def to(self, device: torch.device) -> Texels:
        """Return the same on a device."""
        return Texels(self.shape, self.angles.to(device), self.values.to(device))


_held: Final[WeakValueDictionary[str, Texels]] = WeakValueDictionary()


def read_texels(fabric: Fabric, options: BtfOptions, columns: Mapping[str, npt.NDArray[Any]]) -> Texels:
    """Return a fabric's texels from the columns of their samples; while they are in use, `texels_of` finds them."""
    shape = options.angular_samples.grid(fabric)
    texels = shape[0] * shape[1]
    wi, wo = (np.stack([columns[f"{name}_{axis}"][::texels] for axis in "xyz"], axis=-1) for name in ("wi", "wo"))
    values = np.stack([columns[name].reshape(len(wi), texels).astype(np.float16) for name in COMPONENTS], axis=-1)
    angles = angles_of(torch.from_numpy(wi), torch.from_numpy(wo))
    result = _held[_key(fabric, options)] = Texels(shape, angles, torch.from_numpy(values))
    return result


def texels_of(fabric: Fabric, options: BtfOptions) -> Texels:
    """Return a fabric's texels: those in use in this process, such as a training's, else computed now."""
    texels = _held.get(_key(fabric, options))
    if texels is not None:
        return texels
    wanted = options.angular_samples
    return read_texels(fabric, options, wanted.answer(fabric, 0, wanted.count(fabric)))


def _key(fabric: Fabric, options: BtfOptions) -> str:
    return fingerprint([fabric.optics(), options.angular_samples.model_dump(mode="json")])


def angles_of(wi: Tensor, wo: Tensor) -> Tensor:
    """Return directions (..., 3), above the cloth, as four numbers (..., 4): x and y over 1 + z of each.

    These stay smooth at grazing angles.
    """
    return torch.cat([w[..., :2] / (1.0 + w[..., 2:]) for w in (wi, wo)], dim=-1)


class SetEncoder(nn.Module):
    """Angular samples of texels to their latents, whatever the samples' number and order [Zaheer2017DeepSets].

    A perceptron turns the angles of a sample into m weights; weights times sample are averaged over the samples, and
    one layer takes the mean to the latent. All texels of a fabric are seen under the same directions, so that the
    weights are computed once for all of them.
    """

    def __init__(self, options: EncoderOptions) -> None:
        super().__init__()
        self.weigh = perceptron(_DIRECTION_NUMBERS, options.encoder_hidden, _ENCODER_LAYERS, options.weights)
        self.join = nn.Linear(options.channels * options.weights, options.latent)
        self.register_buffer("scale", torch.ones(options.channels))
        self.scale: Tensor

    def forward(self, angles: Tensor, values: Tensor) -> Tensor:
        """Encode T texels, (T, latent), from values (n, T, c) under the same n pairs of directions, angles (n, 4)."""
        count, texels, _ = values.shape
        weights = self.weigh(angles) / count
        return self._joined((values.flatten(1).t() @ weights).reshape(texels, -1))

    def of_rows(self, texel: Tensor, angles: Tensor, values: Tensor, texels: int) -> Tensor:
        """Encode T texels, (T, latent), from N rows, each a texel's number, angles (N, 4) and values (N, c).

        Every texel has any number of rows, at least one.
        """
        counts = torch.bincount(texel, minlength=texels).to(values.dtype)
        sums = values.new_zeros(texels, self.join.in_features)
        for start in range(0, len(texel), _ROWS):
            rows = slice(start, start + _ROWS)
            products = values[rows].unsqueeze(-1) * self.weigh(angles[rows]).unsqueeze(1)
            sums.index_add_(0, texel[rows], products.flatten(1))
        return self._joined(sums / counts.unsqueeze(-1))

    def _joined(self, mean: Tensor) -> Tensor:
        """Return latents of mean products, (T, c m): channel by channel, m numbers each."""
        scale = self.scale.repeat_interleave(mean.shape[1] // len(self.scale))
        return functional.relu(functional.linear(mean, self.join.weight * scale, self.join.bias))


class BtfNetwork(EncoderDecoder):
    """A decoder of texels' latents; subclasses say where the latents of a fabric come from."""

    options: BtfOptions
    decoder: nn.Sequential

    def __init__(self, options: BtfOptions) -> None:
        super().__init__()
        self.options = options
        inputs = options.latent + _DIRECTION_NUMBERS
        self.decoder = perceptron(inputs, options.hidden, _DECODER_LAYERS, options.channels)

    def latents_of(self, index: int, random: np.random.Generator) -> Tensor:
        """Return the latents (rows, columns, latent) of a fabric trained on, for a training step."""
        raise NotImplementedError

    def read(self, pyramid: list[Tensor], u: Tensor, v: Tensor, sigma: Tensor) -> Tensor:
        """Return the latents (n, latent) of footprints: centres as shares of the repeat, sigma in yarn spacings."""
        options = self.options
        # The pyramid takes a texel's footprint to be half a texel.
        return read_pyramid(pyramid, u, v, sigma * (0.5 / options.texel_sigma), options.texels_per_yarn)

    def decode(self, latents: Tensor, angles: Tensor) -> Tensor:
        """Answer in network space, (..., channels), under pairs of directions (..., 4) (`angles_of`)."""
        output: Tensor = self.decoder(torch.cat([latents, angles], dim=-1))
        return output

    def components(self, *inputs: Tensor) -> Tensor:
        """Return components (n, 4) from the columns of queries and the levels of a pyramid."""
        u, v, sigma, wi, wo, *pyramid = inputs
        latent = once_a_place(lambda *place: self.read(pyramid, *place), u, v, sigma)
        return self.answers(latent, angles_of(wi, wo))

    def answers(self, latents: Tensor, angles: Tensor) -> Tensor:
        """Return components (..., 4) of latents of a fabric (..., latent) under pairs of directions (..., 4)."""
        return to_components(self.decode(latents, angles), self.options.log_k)

    def loss(self, batch: Batch, random: np.random.Generator) -> Tensor:
        """Return the weighted squared error in network space."""
        latents = [self.latents_of(index, random) for index in batch.fabric.tolist()]
        return component_error(self.decoded(latents, batch), batch.target.flatten(0, 1), self.options)

    def decoded(self, latents: Sequence[Tensor], batch: Batch) -> Tensor:
        """Answer a batch in network space, (F n, channels), by the latents (rows, columns, latent) of its fabrics."""
        options = self.options
        strange = (batch.wi[..., 2] < 0) | (batch.curvature > 0) | (batch.sigma_minor != batch.sigma)
        if bool(strange.any()):
            allowed = (
                "learns front light, round footprints and flat cloth only: leave behind, stretch and curvature out"
            )
            raise BadInput("training", "model", options.model, allowed)
        read = []
        for position, own in enumerate(latents):
            picks, ends = (extent // options.texels_per_yarn for extent in own.shape[:2])
            u, v = batch.u[position] / ends, batch.v[position] / picks
            read.append(self.read(averaged(own), u, v, batch.sigma[position]))
        return self.decode(torch.cat(read), angles_of(batch.wi, batch.wo).flatten(0, 1))

    def start_at(self, target: Tensor) -> None:
        """Set the last bias to the mean target, and the last weights small."""
        last = self.decoder[-1]
        assert isinstance(last, nn.Linear)
        start_at_mean(last, target, self.options.log_k)
        with torch.no_grad():
            last.weight.mul_(0.1)


class UnifiedBtfNetwork(BtfNetwork):
    """Encoder and decoder, with the samples of the fabrics trained on, by index in batches; none for inference."""

    options: EncoderOptions
    encoder: SetEncoder

    def __init__(self, options: EncoderOptions, texels: Sequence[Texels] = ()) -> None:
        super().__init__(options)
        self.encoder = SetEncoder(options)
        self._held = tuple(texels)  # kept in use, so that validation finds them
        self._texels = list(texels)

    def latents_of(self, index: int, random: np.random.Generator, paint: Tensor | None = None) -> Tensor:
        """Encode a fabric trained on from a random number of its samples, in the colours `paint` (4, 3) if given."""
        device = self.encoder.scale.device
        texels = self._texels[index] = self._texels[index].to(device)
        count = len(texels.angles)
        chosen = random.permutation(count)[: random.integers(self.options.fewest_samples, count, endpoint=True)]
        return self.encode(texels, chosen, paint)

    def encode(self, texels: Texels, chosen: Index | None = None, paint: Tensor | None = None) -> Tensor:
        """Return the latents (rows, columns, latent) of a fabric's texels, from all samples or the `chosen` ones."""
        angles, values = texels.angles, texels.values
        if chosen is not None:
            index = torch.from_numpy(chosen).to(values.device)
            angles, values = angles[index], values[index]
        values = values.to(torch.float32)
        latents: Tensor = self.encoder(angles, values if paint is None else values @ paint)
        return latents.reshape(*texels.shape, -1)

    def encoded(self, fabric: Fabric) -> tuple[Tensor, ...]:
        """Compute a fabric's samples and encode them, by one forward pass; return the levels of its pyramid."""
        texels = texels_of(fabric, self.options)
        latents = self.latents(texels.angles, texels.values.to(torch.float32))
        return tuple(level.contiguous() for level in averaged(latents.reshape(*texels.shape, -1)))

    def latents(self, angles: Tensor, values: Tensor) -> Tensor:
        """Return what `answers` reads of T texels of a fabric, (T, numbers); arguments as of `SetEncoder`."""
        latents: Tensor = self.encoder(angles, values)
        return latents

    def start_at(self, target: Tensor) -> None:
        """As the decoder alone does; and set the scale of samples to that of targets."""
        super().start_at(target)
        with torch.no_grad():
            self.encoder.scale.copy_(1.0 / target.square().mean(dim=0).sqrt().clamp_min(1e-6))


class RgbBtfNetwork(UnifiedBtfNetwork):
    """Encoder and decoder of RGB, whatever the material: fabrics are trained on in random colours.

    Components are answered as colours: latents are those of two sets of them.
    """

    def latents(self, angles: Tensor, values: Tensor) -> Tensor:
        """Return the latents of T texels in both sets of colours, (T, 2 latent)."""
        paints = (torch.tensor(paint, dtype=torch.float32) for paint in _PAINTS)
        return torch.cat([self.encoder(angles, values @ paint) for paint in paints], dim=-1)

    def answers(self, latents: Tensor, angles: Tensor) -> Tensor:
        """Return components (..., 4): RGB in one set of colours, and the mean of RGB in the other."""
        first, second = (self.to_rgb(part, angles) for part in latents.chunk(2, dim=-1))
        return torch.cat([first, second.mean(dim=-1, keepdim=True)], dim=-1)

    def to_rgb(self, latents: Tensor, angles: Tensor) -> Tensor:
        """Return linear RGB, at least 0, (..., 3)."""
        output = self.decode(latents, angles)
        return (torch.expm1(output.to(torch.float32)) / self.options.log_k).clamp_min_(0.0)

    def loss(self, batch: Batch, random: np.random.Generator) -> Tensor:
        """Return the squared error of RGB in log space, each fabric in colours of its own."""
        shape = len(batch.fabric), len(COMPONENTS), 3
        drawn = random.random(shape) * (random.random(shape) < _PAINTED)
        paints = torch.from_numpy(drawn.astype(np.float32)).to(batch.target.device)
        pairs = zip(batch.fabric.tolist(), paints, strict=True)
        output = self.decoded([self.latents_of(index, random, paint) for index, paint in pairs], batch)
        return (output - torch.log1p(self.options.log_k * (batch.target @ paints)).flatten(0, 1)).square().mean()

    def start_at(self, target: Tensor) -> None:
        """Set the last bias to the mean of painted targets, the last weights small, and the scale of samples."""
        painted = 0.5 * _PAINTED * target.sum(dim=1)
        last = self.decoder[-1]
        assert isinstance(last, nn.Linear)
        with torch.no_grad():
            last.bias.fill_(torch.log1p(self.options.log_k * painted).mean())
            last.weight.mul_(0.1)
            self.encoder.scale.fill_(1.0 / painted.square().mean().sqrt().clamp_min(1e-6))


class UniversalNetwork(BtfNetwork):
    """Decoder, with the latents of fabrics trained on, by the fingerprint of a fabric's optics.

    `keys` are those of the fabrics, by index in batches, and `texels` their samples; none for inference. `grids` are
    their rows and columns of texels. Fabrics that differ in colour alone share latents.
    """

    options: UniversalOptions

    def __init__(
        self,
        options: UniversalOptions,
        grids: Mapping[str, tuple[int, int]],
        keys: Sequence[str] = (),
        texels: Sequence[Texels] = (),
    ) -> None:
        super().__init__(options)
        self.encoder = nn.Identity()
        self.latents = nn.ParameterDict({key: torch.zeros(*grid, options.latent) for key, grid in grids.items()})
        self._keys, self._texels = list(keys), list(texels)

    def parameter_groups(self, rate: float) -> list[dict[str, Any]]:
        """Return two groups: a step touches few latents, so their rate is higher."""
        latents = {"params": list(self.latents.values()), "lr": self.options.latent_rate * rate}
        return [{"params": list(self.decoder.parameters()), "lr": rate}, latents]

    def latents_of(self, index: int, random: np.random.Generator) -> Tensor:
        """Return the latents as they are."""
        latents: Tensor = self.latents[self._keys[index]]
        return latents

    def loss(self, batch: Batch, random: np.random.Generator) -> Tensor:
        """Return the error of the rows and, unless they are held out, of some samples of the same fabrics."""
        total = super().loss(batch, random)
        if not torch.is_grad_enabled():
            return total
        for index in batch.fabric.tolist():
            texels = self._texels[index] = self._texels[index].to(total.device)
            total = total + self.sample_error(self.latents_of(index, random), texels, random) / len(batch.fabric)
        return total

    def sample_error(self, latents: Tensor, texels: Texels, random: np.random.Generator) -> Tensor:
        """Return the error for some samples of all texels, and of the means of texels at all levels of the pyramid."""
        count = len(texels.angles)
        chosen = torch.from_numpy(random.choice(count, min(self.options.batch, count), replace=False))
        values = texels.values[chosen].to(torch.float32).reshape(len(chosen), *texels.shape, -1)
        levels = averaged(latents), averaged(values)
        own, targets = (torch.cat([level.flatten(-2).mT for level in pyramid], dim=-2) for pyramid in levels)
        return component_error(self.samples(own, texels.angles[chosen]), targets, self.options)

    def samples(self, latents: Tensor, angles: Tensor) -> Tensor:
        """Return samples (n, T, 4), in network space, of latents (T, latent) under n pairs of directions (n, 4)."""
        return self.decode(latents.expand(len(angles), -1, -1), angles.unsqueeze(1).expand(-1, len(latents), -1))

    def encoded(self, fabric: Fabric) -> tuple[Tensor, ...]:
        """Return the pyramid of the latents learnt with the decoder, or of those that fit the fabric's samples."""
        key = fingerprint(fabric.optics())
        latents = self.latents[key] if key in self.latents else self.fitted(texels_of(fabric, self.options))
        return tuple(level.detach().contiguous() for level in averaged(latents))

    def fitted(self, texels: Texels) -> Tensor:
        """Return the latents (rows, columns, latent) by which the decoder gives texels' samples best, by descent."""
        options, random = self.options, np.random.default_rng(0)
        latents = torch.zeros(*texels.shape, options.latent, requires_grad=True)
        optimiser = torch.optim.Adam([latents], lr=options.rate)
        fall = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, options.steps)
        for _ in range(options.steps):
            with torch.enable_grad():
                (latents.grad,) = torch.autograd.grad(self.sample_error(latents, texels, random), latents)
            optimiser.step()
            fall.step()
        return latents.detach()


class SampleEncoder(NetworkMethod[BtfNetwork]):
    """A trained encoder of samples of any fabric, with its decoder."""

    def encode(self, wi: Float32, wo: Float32, values: Float32) -> Float32:
        """Return latents (T, numbers) of components (n, T, 4) under n pairs of directions, (n, 3) each."""
        with torch.inference_mode():
            return self._network.latents(_angles(wi, wo), torch.from_numpy(values)).numpy()

    def decode(self, latents: Float32, wi: Float32, wo: Float32) -> Float32:
        """Return the components (n, T, 4) of latents under n pairs of directions."""
        angles, own = _angles(wi, wo).unsqueeze(1).expand(-1, len(latents), -1), torch.from_numpy(latents)
        with torch.inference_mode():
            return self._network.answers(own.expand(len(angles), -1, -1), angles).numpy()

    @property
    def _network(self) -> UnifiedBtfNetwork:
        (network,) = self._networks.values()
        assert isinstance(network, UnifiedBtfNetwork)
        return network


def _angles(wi: Float32, wo: Float32) -> Tensor:
    return angles_of(torch.from_numpy(wi), torch.from_numpy(wo))


def averaged(latents: Tensor) -> list[Tensor]:
    """Return the MIP pyramid (..., latent, rows, columns) of latents (..., rows, columns, latent), finest first.

    Every level is averaged from the finest, so that the last, one texel, is the mean of all whatever the extents.
    """
    finest = latents.movedim(-1, -3)
    rows, columns = finest.shape[-2:]
    _, *coarser = level_shapes(1, 0, (columns, rows))
    return [finest, *(functional.adaptive_avg_pool2d(finest, shape) for shape in coarser)]


def build(
    options: BtfOptions, fabrics: Sequence[Fabric], samples: Sequence[Mapping[str, npt.NDArray[Any]]]
) -> BtfNetwork:
    """Return an untrained network for these fabrics, with their angular samples by column."""
    texels = [read_texels(fabric, options, columns) for fabric, columns in zip(fabrics, samples, strict=True)]
    if isinstance(options, UniversalOptions):
        keys = [fingerprint(fabric.optics()) for fabric in fabrics]
        grids = {key: own.shape for key, own in zip(keys, texels, strict=True)}
        return UniversalNetwork(options, grids, keys, texels)
    assert isinstance(options, EncoderOptions)
    return _encoding(options, texels)


def restore(options: BtfOptions, trained: Trained) -> list[NetworkMethod[BtfNetwork]] | list[MeasuredCloth]:
    """Return the method that trained networks are, or a material of measured samples is.

    BadInput if samples are answered by other physics than rows.
    """
    card, weights = trained[0]
    if MEASURED in card:
        assert isinstance(options, EncoderOptions)
        return [_measured(options, card[MEASURED], weights)]

    def empty(_: tuple[int, int]) -> BtfNetwork:
        if isinstance(options, UniversalOptions):
            shapes = {name: own.shape for name, own in weights.items() if name.startswith("latents.")}
            grids = {name.removeprefix("latents."): (rows, columns) for name, (rows, columns, _) in shapes.items()}
            return UniversalNetwork(options, grids)
        assert isinstance(options, EncoderOptions)
        return _encoding(options)

    networks, domain = restored(options, trained, empty)
    if domain is not None:
        domain.refuse_truth(options.truth, options.name)
        # Whatever else the rows held: footprints are read as round, and the cloth as flat.
        plain = QueryOptions(**domain.queries.model_dump(include={"sigma", "directions", "max_angle"}))
        domain = domain.model_copy(update={"queries": plain})
    return [(SampleEncoder if options.encodes else NetworkMethod)(networks, domain)]


def _measured(options: EncoderOptions, about: dict[str, Any], weights: Mapping[str, Tensor]) -> MeasuredCloth:
    """Return the material that latents and a decoder are."""
    network = RgbBtfNetwork(options).eval()
    decoder = {key: values for key, values in weights.items() if key != LATENTS}
    network.decoder.load_state_dict({key.removeprefix("decoder."): values for key, values in decoder.items()})
    (rows, columns, _), (width, height) = weights[LATENTS].shape, about["size"]
    pyramid = [level.contiguous() for level in averaged(weights[LATENTS])]
    # The network has footprints in yarn spacings, of so many texels each.
    spacing = options.texels_per_yarn * math.sqrt(width * height / (rows * columns))

    def rgb(u: Tensor, v: Tensor, sigma: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        latent = once_a_place(lambda *place: network.read(pyramid, *place), u, v, sigma / spacing)
        return network.to_rgb(latent, angles_of(wi, wo))

    return MeasuredCloth(about, rgb, network.stored(tuple(pyramid)))


def _encoding(options: EncoderOptions, texels: Sequence[Texels] = ()) -> UnifiedBtfNetwork:
    return (UnifiedBtfNetwork if options.channels == len(COMPONENTS) else RgbBtfNetwork)(options, texels)
