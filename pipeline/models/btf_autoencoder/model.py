"""An autoencoder of one fabric's bidirectional texture [Rainer2019Neural]: `unified_btf` with a latent of 8.

One network for each fabric, so that eight numbers a texel are enough; with 3 outputs the decoder has the published
35,725 weights. ADAPTED: the encoder is that of 2020, which reads any number of samples, and so are values and loss.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from pipeline.fingerprint import fingerprint
from pipeline.models.btf_autoencoder import BtfAutoencoderOptions
from pipeline.models.domain import Domain, joined_domain
from pipeline.models.network import PerQuery, Trained
from pipeline.models.per_fabric import PerFabric
from pipeline.models.unified_btf.model import UnifiedBtf, UnifiedBtfNetwork, restored
from pipeline.models.unified_btf.model import build as unified_btf
from pipeline.truth.query import Queries
from weaves.fabric import Fabric


class BtfAutoencoder:
    """Trained autoencoders, one for each fabric.

    Parameters
    ----------
    name : str
        Name of the method.
    methods : dict
        From the fingerprint of a fabric's optics to the network's own method.
    domain : Domain, optional
        Domain of the training; any query if left out.
    """

    def __init__(self, name: str, methods: dict[str, UnifiedBtf], domain: Domain | None = None) -> None:
        self.name, self.setting, self.domain = name, "", domain
        self._methods = methods
        self._known = PerFabric(lambda fabric: methods[fingerprint(fabric.optics())])

    def covers(self, fabric: Fabric) -> bool:
        """Return whether the model was trained on a fabric."""
        return fingerprint(fabric.optics()) in self._methods

    def prepare(self, fabric: Fabric) -> None:
        """Encode the fabric's texels, once."""
        self._known.of(fabric).prepare(fabric)

    def predict(self, fabric: Fabric, queries: Queries, seed: int = 0) -> npt.NDArray[np.float32]:
        """Answer N queries, float32 (N, 4); `seed` is not used. BadInput for kinds of queries not trained on."""
        return self._known.of(fabric).predict(fabric, queries, seed)

    def per_query(self, fabric: Fabric) -> PerQuery:
        """Return the decoder of the fabric's own network."""
        return self._known.of(fabric).per_query(fabric)

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the bytes of the decoder and of the latents, float32."""
        return self._known.of(fabric).bytes_stored(fabric)


def build(
    options: BtfAutoencoderOptions, fabrics: Sequence[Fabric], samples: Sequence[Mapping[str, npt.NDArray[Any]]]
) -> UnifiedBtfNetwork:
    """Return an untrained network with its angular samples by column; there must be exactly one fabric."""
    (fabric,) = fabrics
    return unified_btf(options, [fabric], samples)


def restore(options: BtfAutoencoderOptions, trained: Trained) -> list[BtfAutoencoder]:
    """Return one method that holds all trained fabrics."""
    methods = {}
    for card, weights in trained:
        network, domain = restored(options, card, weights)
        (fabric,) = card["fabrics"]
        methods[fabric["optics"]] = UnifiedBtf(network, domain)
    return [BtfAutoencoder(options.name, methods, joined_domain([card for card, _ in trained]))]
