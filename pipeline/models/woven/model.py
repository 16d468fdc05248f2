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

Maps and parameters are read in pipeline.models.woven.encoder. OWN CHANGE, `one_blob = "local"`: the encoder also gives
a picture of the repeat, and the decoder sees it from the queried place (pipeline.models.woven.decoder).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn

from pipeline.models.domain import Domain, domain_of
from pipeline.models.method import in_repeat
from pipeline.models.network import Answering, Batch, PerQuery, Trained, columns_of, in_chunks, loaded
from pipeline.models.networks.layers import SLOPE, EncoderDecoder, to_components, to_network, weighted_error
from pipeline.models.per_fabric import PerFabric
from pipeline.models.woven import WovenOptions
from pipeline.models.woven.decoder import Decoder, encode_patch
from pipeline.models.woven.encoder import Encoder, WovenInputs, read_cloth
from pipeline.models.woven.standard_position import Placement
from pipeline.truth.query import Queries
from weaves.errors import BadInput
from weaves.fabric import Fabric


class WovenNetwork(EncoderDecoder):
    """Encoder and decoder, with the cloth it is trained on.

    Parameters
    ----------
    options : WovenOptions
        The design.
    fabrics : sequence of Fabric
        Training fabrics, addressed by index in batches; none for inference.
    """

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
        """Answer in network space, for fabrics in standard position.

        Parameters
        ----------
        latent : Tensor (F, latent)
            From `encode`.
        placement : Placement
            Placement of the F fabrics.
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
        where, patch = encode_patch(self.options, u, v, sigma, placement.repeat)
        output: Tensor = self.decoder(latent, where, patch, wi, wo)
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


class Woven:
    """A trained network that answers for any fabric; it encodes each once.

    Parameters
    ----------
    network : WovenNetwork
        Trained weights.
    domain : Domain, optional
        Domain of the training; any query if left out.
    device : torch.device
        Device of the computation.
    """

    def __init__(self, network: WovenNetwork, domain: Domain | None = None, device: torch.device | None = None) -> None:
        self.name, self.setting, self.domain = network.options.name, "", domain
        self._device = device or torch.device("cpu")
        self._network = network.eval().to(self._device)
        self._encoded = PerFabric(self._encode)
        self._answering = Answering(self._network, self._all_at_once)

    def covers(self, fabric: Fabric) -> bool:
        """Return True: any fabric can be encoded."""
        return True

    def prepare(self, fabric: Fabric) -> None:
        """Encode the fabric, once."""
        self._encoded.of(fabric)

    def predict(self, fabric: Fabric, queries: Queries, seed: int = 0) -> npt.NDArray[np.float32]:
        """Answer N queries, float32 (N, 4); `seed` is not used. BadInput for kinds of queries not trained on."""
        return self._components(queries, *self._encoded.of(fabric))

    def predict_between(self, first: Fabric, second: Fabric, share: float, queries: Queries) -> npt.NDArray[np.float32]:
        """Answer for a blend of two fabrics: their latents are blended, no intermediate fabric is encoded.

        Parameters
        ----------
        first, second : Fabric
            Two fabrics of one repeat. The second one is placed as the first one is, because blended latents must lie in
            the same place.
        share : float
            Share of the second fabric's latent; 0 is the first fabric, 1 the second.
        queries : Queries
            N queries, in yarn spacings of either fabric.

        Returns
        -------
        float32 (N, 4)

        Raises
        ------
        BadInput
            If the repeats differ, or for kinds of queries not trained on.
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

    def transparency(self, fabric: Fabric, queries: Queries, seed: int = 0) -> npt.NDArray[np.float32]:
        """Return the share of light from straight behind that passes unscattered, float32 (N,) in [0, 1].

        0 if `transmission` was not learnt.
        """
        if not self._network.options.transmission:
            return np.zeros(len(queries.u), np.float32)

        def read(output: Tensor) -> Tensor:
            return output[0, :, 4:].clamp(0.0, 1.0).expand(-1, 4)

        return self._answer(queries, *self._encoded.of(fabric), read)[:, 0].copy()

    def _components(self, queries: Queries, latent: Tensor, place: Placement) -> npt.NDArray[np.float32]:
        log_k = self._network.options.log_k
        return self._answer(queries, latent, place, lambda output: to_components(place.swap(output[..., :4])[0], log_k))

    def _answer(
        self, queries: Queries, latent: Tensor, place: Placement, read: Callable[[Tensor], Tensor]
    ) -> npt.NDArray[np.float32]:
        self._refuse(queries)

        def answer(*columns: Tensor) -> Tensor:
            return read(self._network.decode(latent, place, *(column.unsqueeze(0) for column in columns)))

        ends, picks = place.own_repeat()[0].tolist()
        return in_chunks(in_repeat(queries, (int(ends), int(picks))), answer, self._device)

    def per_query(self, fabric: Fabric) -> PerQuery:
        """Return the decoder; latent and placement are its constants, so that all fabrics share it."""
        latent, place = self._encoded.of(fabric)
        repeat = fabric.weave.repeat
        return PerQuery(
            self._refuse, lambda queries: columns_of(in_repeat(queries, repeat)), self._answering, (latent, *place)
        )

    def _all_at_once(self, u: Tensor, v: Tensor, sigma: Tensor, wi: Tensor, wo: Tensor, *fabric: Tensor) -> Tensor:
        latent, place = fabric[0], Placement(*fabric[1:])
        columns = (column.unsqueeze(0) for column in (u, v, sigma, wi, wo))
        output = self._network.decode(latent, place, *columns)
        return to_components(place.swap(output[..., :4])[0], self._network.options.log_k)

    def _refuse(self, queries: Queries) -> None:
        if self.domain is not None:
            self.domain.refuse(queries, self.name)

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the bytes of the decoder and of the fabric's latent; the encoder is not needed to render."""
        latent, _ = self._encoded.of(fabric)
        return 4 * (sum(weight.numel() for weight in self._network.decoder.parameters()) + latent.numel())

    def _encode(self, fabric: Fabric) -> tuple[Tensor, Placement]:
        with torch.no_grad():
            cloth = read_cloth([fabric], self._network.options).to(self._device)
            return self._network.encode(cloth), cloth.placement


def build(options: WovenOptions, fabrics: Sequence[Fabric]) -> WovenNetwork:
    """Return an untrained network for these fabrics."""
    return WovenNetwork(options, fabrics)


def restore(options: WovenOptions, trained: Trained) -> list[Woven]:
    """Return the method that a trained network is."""
    return [Woven(loaded(WovenNetwork(options), weights), domain_of(card)) for card, weights in trained]
