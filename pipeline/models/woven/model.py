"""One network for many woven fabrics at many scales [Chen2024Woven].

An encoder reads a fabric's normal and tangent maps over one repeat, and four parameters, into a latent of 64 numbers;
it runs once a fabric. A decoder reads the latent, the patch P = (u, v, size) as one-blobs, and the directions, and
answers with the four components, the specular ones in log space:

    encoder   maps 6 x side x side -> residual convolutions, padded around the repeat -> 64
              + (alpha, beta) of both yarns -> 128 -> residual -> 64
    fusion    latent 64 + one-blob(P) 24 -> 128 -> 128 -> 64
    angular   + wi xyz + wo xy = 69 -> 128 -> residual -> 64 -> 4

A residual block is two fully connected layers with the skip added before the last activation; a leaky ReLU follows
every layer, the last one too. Sources differ on one layer 128 -> 128, the option `extra_layer`: the paper's
figure gives a decoder of 70,148 parameters; we read a further layer into its encoder. 86,660 parameters, which we infer
from notes, need it in the fusion. Unknown, so chosen here: the encoder of the maps (the whole network takes about 5 MB
there and 1.2 MB here), the scale of the size, the training on all mirror images.

Maps and parameters are read in pipeline.models.woven.encoder. OWN CHANGE, `one_blob = "local"`: the encoder also gives
a picture of the repeat, and the decoder sees it from the queried place (pipeline.models.woven.decoder).
"""

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor, nn

from pipeline.compiled.arrays import Float32
from pipeline.models.network import Batch, NetworkMethod, Trained, restored
from pipeline.models.networks.layers import (
    SLOPE,
    EncoderDecoder,
    LinearLayer,
    component_error,
    once_a_place,
    start_at_mean,
    to_components,
)
from pipeline.models.woven import WovenOptions
from pipeline.models.woven.decoder import Decoder, encode_patch
from pipeline.models.woven.encoder import Encoder, WovenInputs, read_cloth
from pipeline.models.woven.standard_position import Placement
from pipeline.truth.query import Queries
from weaves.errors import BadInput
from weaves.fabric import Fabric


class WovenNetwork(EncoderDecoder):
    """Encoder and decoder, with the fabrics it is trained on, addressed by index in batches; none for inference."""

    options: WovenOptions
    encoder: Encoder
    decoder: Decoder

    def __init__(self, options: WovenOptions, fabrics: Sequence[Fabric] = ()) -> None:
        super().__init__()
        self.options = options
        self.encoder, self.decoder = Encoder(options), Decoder(options)
        for layer in self.modules():
            if isinstance(layer, nn.Linear | nn.Conv2d) and layer.bias is not None:
                nn.init.kaiming_normal_(layer.weight, a=SLOPE)
                nn.init.zeros_(layer.bias)
        self._cloth = read_cloth(fabrics, options) if fabrics else None

    def encode(self, cloth: WovenInputs) -> Tensor:
        """Return the latents (F, latent)."""
        latents: Tensor = self.encoder(cloth.maps, cloth.parameters)
        return latents

    def decode(
        self, latent: Tensor, placement: Placement, u: Tensor, v: Tensor, sigma: Tensor, wi: Tensor, wo: Tensor
    ) -> Tensor:
        """Answer in network space, for fabrics in standard position, (F, n, 4), transparency appended if it is learnt.

        `latent` (F, latent) is from `encode`; centres u and v (F, n) are shares of each fabric's own repeat, sigma (F,
        n) in yarn spacings. `placement.swap` gives the fabric's own components.
        """
        return self.decoder.lit(self.seen(latent, placement, u, v, sigma, wo), placement.turn(wi))

    def seen(self, latent: Tensor, placement: Placement, u: Tensor, v: Tensor, sigma: Tensor, wo: Tensor) -> Tensor:
        """Return what the lights of a place share, (F, n, hidden)."""
        u, v = placement.move(u, v)
        where, patch = encode_patch(self.options, u, v, sigma, placement.repeat)
        return self.decoder.seen(latent, where, patch, placement.turn(wo))

    def encoded(self, fabric: Fabric) -> tuple[Tensor, ...]:
        """Encode a fabric; return its latent and its placement."""
        cloth = read_cloth([fabric], self.options)
        return self.encode(cloth), *cloth.placement

    def components(self, *inputs: Tensor) -> Tensor:
        """Return components (n, 4) from the columns of queries, and the latent and placement of a fabric."""
        return to_components(Placement(*inputs[6:]).swap(self.outputs(*inputs)[..., :4])[0], self.options.log_k)

    def outputs(self, *inputs: Tensor) -> Tensor:
        """Return the outputs of the decoder, (1, n, 4 or 5), from the inputs of `components`."""
        (u, v, sigma, wi, wo), latent, placement = inputs[:5], inputs[5], Placement(*inputs[6:])

        def seen(*place: Tensor) -> Tensor:
            return self.seen(latent, placement, *(column.unsqueeze(0) for column in place))[0]

        shared = once_a_place(seen, u, v, sigma, wo).unsqueeze(0)
        return self.decoder.lit(shared, placement.turn(wi.unsqueeze(0)))

    def stored(self, constants: tuple[Tensor, ...]) -> int:
        """Return the numbers of the decoder and of the fabric's latent."""
        return super().stored(constants[:1])

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
        error = component_error(output[..., :4], cloth.placement.swap(batch.target), options)
        if options.transmission:
            error = error + options.transparency_weight * (output[..., 4] - batch.transparency).square().mean()
        return error

    def start_at(self, target: Tensor) -> None:
        """Set the last bias to the mean target, and the last weights small: a leaky ReLU can stall far from it."""
        start_at_mean(self.decoder.last, target, self.options.log_k)
        with torch.no_grad():
            self.decoder.last.weight.mul_(0.01)


class Woven(NetworkMethod[WovenNetwork]):
    """A trained network that answers for any fabric; it encodes each once."""

    def layers_of(self, fabric: Fabric) -> tuple[dict[str, LinearLayer], Placement]:
        """Return the layers of the decoder for a fabric (`Decoder.layers_of`), and its placement."""
        network = self.network_of(fabric)
        with torch.no_grad():
            latent, *placement = network.encoded(fabric)
            return network.decoder.layers_of(latent), Placement(*placement)

    def predict_between(self, first: Fabric, second: Fabric, share: float, queries: Queries) -> Float32:
        """Answer, (N, 4), for a blend of two fabrics: their latents are blended, no intermediate fabric is encoded.

        `share` is that of the second fabric's latent. Queries are in yarn spacings of either fabric, which have one
        repeat; the second one is placed as the first one is, because blended latents must lie in the same place.
        BadInput if the repeats differ, or for kinds of queries not trained on.
        """
        if first.weave.repeat != second.weave.repeat:
            (ends, picks), allowed = second.weave.repeat, "the repeat of {} is needed, {} x {}, to blend the two"
            raise BadInput(second.name, "repeat", f"{ends} x {picks}", allowed.format(first.name, *first.weave.repeat))
        network = self.network_of(first)
        with torch.inference_mode():
            cloth = read_cloth([first, second], network.options, like=first)
            one, other = network.encode(cloth)
            blended = torch.lerp(one, other, share).unsqueeze(0)
            place = cloth.take(torch.tensor([0])).placement
        return self._part(first, (blended, *place)).answered(queries)

    def transparency(self, fabric: Fabric, queries: Queries, seed: int = 0) -> Float32:
        """Return the share of light from straight behind that passes unscattered, (N,) in [0, 1]; 0 if not learnt."""
        if not self.options.transmission:
            return np.zeros(len(queries.u), np.float32)
        network = self.network_of(fabric)

        def read(*inputs: Tensor) -> Tensor:
            return network.outputs(*inputs)[0, :, 4:].clamp(0.0, 1.0)

        return self.per_query(fabric).answered(queries, read, 1)[:, 0]


def build(options: WovenOptions, fabrics: Sequence[Fabric]) -> WovenNetwork:
    """Return an untrained network for these fabrics."""
    return WovenNetwork(options, fabrics)


def restore(options: WovenOptions, trained: Trained) -> list[Woven]:
    """Return the method that a trained network is."""
    return [Woven(*restored(options, trained, lambda _: WovenNetwork(options)))]
