"""Methods with one network per fabric: textures and perceptrons, as `neumip` and `curved` train them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic

import torch

from pipeline.fingerprint import fingerprint
from pipeline.models.domain import Domain, joined_domain
from pipeline.models.network import Net, Trained, loaded
from pipeline.models.per_fabric import PerFabric
from weaves.fabric import Fabric


class OneMaterial(Generic[Net]):
    """Trained networks, one for each fabric.

    Parameters
    ----------
    name : str
        Name of the method.
    networks : dict
        From the fingerprint of a fabric's optics to its network.
    domain : Domain, optional
        Domain of the training; any query if left out.
    device : torch.device
        Device of the computation.
    """

    def __init__(
        self,
        name: str,
        networks: dict[str, Net],
        domain: Domain | None = None,
        device: torch.device | None = None,
    ) -> None:
        self.name, self.setting, self.domain = name, "", domain
        self._device = device or torch.device("cpu")
        self._networks = {key: network.eval().to(self._device) for key, network in networks.items()}
        self._known = PerFabric(lambda fabric: self._networks[fingerprint(fabric.optics())])

    def covers(self, fabric: Fabric) -> bool:
        """Return whether the model was trained on a fabric."""
        return fingerprint(fabric.optics()) in self._networks

    def prepare(self, fabric: Fabric) -> None:
        """Do nothing: the textures are in memory."""

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the bytes of textures and perceptrons, float32."""
        return 4 * sum(weight.numel() for weight in self.network_of(fabric).parameters())

    def network_of(self, fabric: Fabric) -> Net:
        """Return the network of a fabric that is covered."""
        return self._known.of(fabric)


def restored(trained: Trained, make: Callable[[tuple[int, int]], Net]) -> tuple[dict[str, Net], Domain | None]:
    """Return the networks of trained cards and weights by the fabrics' optics, and their joint domain.

    `make` returns an untrained network for a repeat (ends, picks).
    """
    networks = {}
    for card, weights in trained:
        (fabric,) = card["fabrics"]
        ends, picks = fabric["repeat"]
        networks[fabric["optics"]] = loaded(make((ends, picks)), weights)
    return networks, joined_domain([card for card, _ in trained])
