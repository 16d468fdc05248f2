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
that every model is measured alike. With 3 outputs the decoder has the published 38,269 weights. Not published, so
chosen here: m, the widths of the encoder, the activations, the loss, the parameterisation of directions. Reflection of
round footprints only, as published.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn
from torch.nn import functional

from pipeline.models.domain import Domain, domain_of
from pipeline.models.method import in_repeat
from pipeline.models.network import Answering, Batch, PerQuery, Trained, columns_of, in_chunks, loaded
from pipeline.models.networks.layers import EncoderDecoder, perceptron, to_components, to_network, weighted_error
from pipeline.models.networks.texture import level_shapes, read_pyramid
from pipeline.models.per_fabric import PerFabric
from pipeline.models.unified_btf import BtfOptions, UnifiedBtfOptions
from pipeline.models.unified_btf.set_encoder import (
    DIRECTION_NUMBERS,
    SetEncoder,
    Texels,
    TexelSamples,
    angles_of,
    angular_samples,
    read_samples,
    read_texels,
)
from pipeline.shards.queries import QueryOptions
from pipeline.truth.query import Queries
from weaves.errors import BadInput
from weaves.fabric import Fabric

_LAYERS = 4  # hidden ones of the decoder


def decoder(latent: int, hidden: int, outputs: int = 4) -> nn.Sequential:
    """Return the published decoder: latent and angles to `outputs` numbers."""
    return perceptron(latent + DIRECTION_NUMBERS, hidden, _LAYERS, outputs)


class UnifiedBtfNetwork(EncoderDecoder):
    """Encoder and decoder, with the samples of the fabrics they are trained on.

    Parameters
    ----------
    options : BtfOptions
        The design.
    samples : sequence of TexelSamples
        Samples of the training fabrics, addressed by index in batches; none for inference.
    """

    encoder: SetEncoder
    decoder: nn.Sequential

    def __init__(self, options: BtfOptions, samples: Sequence[TexelSamples] = ()) -> None:
        super().__init__()
        self.options = options
        self.encoder, self.decoder = SetEncoder(options), decoder(options.latent, options.hidden)
        self._samples = list(samples)  # kept in use, so that validation finds them
        self._texels = [read_texels(one, options) for one in self._samples]

    def encode(self, texels: Texels, chosen: npt.NDArray[np.int64] | None = None) -> Tensor:
        """Return the latents (rows, columns, latent) of a fabric's texels, from all samples or the `chosen` ones."""
        angles, values = texels.angles, texels.values
        if chosen is not None:
            index = torch.from_numpy(chosen).to(values.device)
            angles, values = angles[index], values[index]
        latents: Tensor = self.encoder(angles, values.to(torch.float32))
        return latents.reshape(*texels.shape, -1)

    def read(self, pyramid: list[Tensor], u: Tensor, v: Tensor, sigma: Tensor) -> Tensor:
        """Return the latents (n, latent) of footprints: centres as shares of the repeat, sigma in yarn spacings."""
        options = self.options
        # The pyramid takes a texel's footprint to be half a texel.
        return read_pyramid(pyramid, u, v, sigma * (0.5 / options.texel_sigma), options.texels_per_yarn)

    def decode(self, latent: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        """Answer in network space, (n, 4)."""
        output: Tensor = self.decoder(torch.cat([latent, angles_of(wi, wo, self.options.angles)], dim=-1))
        return output

    def loss(self, batch: Batch, random: np.random.Generator) -> Tensor:
        """Return the weighted squared error in network space."""
        options = self.options
        strange = (batch.wi[..., 2] < 0) | (batch.curvature > 0) | (batch.sigma_minor != batch.sigma)
        if bool(strange.any()):
            allowed = (
                "learns front light, round footprints and flat cloth only: leave behind, stretch and curvature out"
            )
            raise BadInput("training", "model", options.model, allowed)
        latents = []
        for position, index in enumerate(batch.fabric.tolist()):
            texels = self._texels[index] = self._texels[index].to(batch.u.device)
            picks, ends = (extent // options.texels_per_yarn for extent in texels.shape)
            count = len(texels.angles)
            chosen = random.permutation(count)[: random.integers(options.fewest_samples, count, endpoint=True)]
            pyramid = averaged(self.encode(texels, chosen))
            u, v = batch.u[position] / ends, batch.v[position] / picks
            latents.append(self.read(pyramid, u, v, batch.sigma[position]))
        output = self.decode(torch.cat(latents), batch.wi.flatten(0, 1), batch.wo.flatten(0, 1))
        target = to_network(batch.target.flatten(0, 1), options.log_k)
        return weighted_error(output, target, options.specular_weight, options.diffuse_weight)

    def start_at(self, target: Tensor) -> None:
        """Set the last bias to the mean target, the last weights small, and the scale of samples to that of targets."""
        output = to_network(target, self.options.log_k)
        with torch.no_grad():
            last = self.decoder[-1]
            assert isinstance(last, nn.Linear)
            last.bias.copy_(output.mean(dim=0))
            last.weight.mul_(0.1)
            self.encoder.scale.copy_(1.0 / target.square().mean(dim=0).sqrt().clamp_min(1e-6))


def averaged(latents: Tensor) -> list[Tensor]:
    """Return the MIP pyramid (latent, rows, columns) of latents (rows, columns, latent), finest first.

    Every level is averaged from the finest, so that the last, one texel, is the mean of all whatever the extents.
    """
    finest = latents.permute(2, 0, 1)
    rows, columns = finest.shape[1:]
    _, *coarser = level_shapes(1, 0, (columns, rows))
    return [finest, *(functional.adaptive_avg_pool2d(finest, shape) for shape in coarser)]


class UnifiedBtf:
    """A trained network that answers for any fabric; it computes and encodes the samples of each once.

    Parameters
    ----------
    network : UnifiedBtfNetwork
        Trained weights.
    domain : Domain, optional
        Domain of the training; any query if left out.
    device : torch.device
        Device of the computation.
    """

    def __init__(
        self, network: UnifiedBtfNetwork, domain: Domain | None = None, device: torch.device | None = None
    ) -> None:
        self.name, self.setting, self.domain = network.options.name, "", domain
        self._device = device or torch.device("cpu")
        self._network = network.eval().to(self._device)
        self._pyramids = PerFabric(self._encode)
        self._answering = Answering(self._network, self._components)

    def covers(self, fabric: Fabric) -> bool:
        """Return True: any fabric can be encoded."""
        return True

    def prepare(self, fabric: Fabric) -> None:
        """Compute the fabric's samples and encode them, once: one forward pass, no optimisation."""
        self._pyramids.of(fabric)

    def predict(self, fabric: Fabric, queries: Queries, seed: int = 0) -> npt.NDArray[np.float32]:
        """Answer N queries, float32 (N, 4); `seed` is not used. BadInput for kinds of queries not trained on."""
        self._refuse(queries)
        pyramid = self._pyramids.of(fabric)

        def answer(*columns: Tensor) -> Tensor:
            return self._components(*columns, *pyramid)

        return in_chunks(in_repeat(queries, fabric.weave.repeat), answer, self._device)

    def per_query(self, fabric: Fabric) -> PerQuery:
        """Return the decoder; the levels of the pyramid are its constants, so that fabrics of one repeat share it."""
        pyramid, repeat = self._pyramids.of(fabric), fabric.weave.repeat
        return PerQuery(
            self._refuse, lambda queries: columns_of(in_repeat(queries, repeat)), self._answering, tuple(pyramid)
        )

    def _components(self, u: Tensor, v: Tensor, sigma: Tensor, wi: Tensor, wo: Tensor, *pyramid: Tensor) -> Tensor:
        output = self._network.decode(self._network.read(list(pyramid), u, v, sigma), wi, wo)
        return to_components(output, self._network.options.log_k)

    def _refuse(self, queries: Queries) -> None:
        if self.domain is not None:
            self.domain.refuse(queries, self.name)

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the bytes of the decoder and of the fabric's latents, float32; the encoder is not needed to render."""
        weights = sum(weight.numel() for weight in self._network.decoder.parameters())
        return 4 * (weights + sum(level.numel() for level in self._pyramids.of(fabric)))

    def _encode(self, fabric: Fabric) -> list[Tensor]:
        network = self._network
        samples = angular_samples(fabric, network.options)
        with torch.no_grad():
            texels = read_texels(samples, network.options).to(self._device)
            return [level.contiguous() for level in averaged(network.encode(texels))]


def build(
    options: BtfOptions, fabrics: Sequence[Fabric], samples: Sequence[Mapping[str, npt.NDArray[Any]]]
) -> UnifiedBtfNetwork:
    """Return an untrained network for these fabrics, with their angular samples by column."""
    pairs = zip(fabrics, samples, strict=True)
    return UnifiedBtfNetwork(options, [read_samples(fabric, options, columns) for fabric, columns in pairs])


def restore(options: UnifiedBtfOptions, trained: Trained) -> list[UnifiedBtf]:
    """Return the method that a trained network is."""
    return [UnifiedBtf(*restored(options, card, weights)) for card, weights in trained]


def restored(
    options: BtfOptions, card: dict[str, Any], weights: dict[str, Tensor]
) -> tuple[UnifiedBtfNetwork, Domain | None]:
    """Return a trained network and its domain; BadInput if its samples are answered by other physics than its rows."""
    network, domain = loaded(UnifiedBtfNetwork(options), weights), domain_of(card)
    if domain is not None:
        domain.refuse_truth(options.truth, options.name)
        # Whatever else the rows held: footprints are read as round, and the cloth as flat.
        plain = QueryOptions(**domain.queries.model_dump(include={"sigma", "directions", "max_angle"}))
        domain = domain.model_copy(update={"queries": plain})
    return network, domain
