"""A network from outside: its training behind a guard, and the method that its trained weights are loaded into.

The class from outside has two functions more than `pipeline.models.method.Method`: ``network(fabrics)`` returns an
untrained torch module with the function ``loss``, and ``load(network)`` receives the trained one. Both see fabrics
without colours, which the components do not depend on.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from pipeline.fingerprint import fingerprint
from pipeline.models.added.added_code import AddedMethod
from pipeline.models.added.guarded import Guarded, MethodFailed, faults_of, imported, new
from pipeline.models.domain import domain_of
from pipeline.models.network import Batch, Trainable, Trained
from pipeline.per_fabric import PerFabric
from weaves.draft import Matrix
from weaves.fabric import Fabric


class GuardedNetwork(Trainable):
    """A network from outside behind a guard; of its functions ``loss`` is needed, the others have defaults.

    `fabrics` are those that it learns, `root` is the method's file, or the folder of its package. The training loop
    guards ``loss``, together with the gradients.
    """

    def __init__(self, network: nn.Module, options: AddedMethod, root: Path, fabrics: Sequence[Fabric]) -> None:
        super().__init__()
        self.network, self.options, self.root, self.fabrics = network, options, root, fabrics

    def call(self, function: str) -> AbstractContextManager[None]:
        """Return the guard of a call of one of its functions."""
        return faults_of(self.options.name, function, self.options.limit, self.root)

    def loss(self, batch: Batch, random: np.random.Generator) -> Tensor:
        """Return the loss of a batch; torch's own random numbers depend on seed and step alone, too."""
        torch.manual_seed(int(random.integers(2**63)))
        name = self.options.name
        loss: object = self.network.loss(batch, random)  # type: ignore[operator]
        if not isinstance(loss, Tensor):
            raise MethodFailed(name, f"loss returned {type(loss).__name__}; a tensor with one number is needed")
        if loss.ndim or not loss.is_floating_point():
            form = f"{str(loss.dtype).removeprefix('torch.')} {tuple(loss.shape)}"
            raise MethodFailed(name, f"loss returned a tensor {form}; one number, shape (), is needed")
        if torch.is_grad_enabled() and not loss.requires_grad:
            raise MethodFailed(name, "loss returned a number that does not depend on the network's parameters")
        return loss

    def start_at(self, target: Tensor) -> None:
        """Show the network some targets (M, 4) before the first step."""
        self._own("start_at", super().start_at, target)

    def schedule(self, progress: float) -> None:
        """Adjust scheduled parameters."""
        self._own("schedule", super().schedule, progress)

    def parameter_groups(self, rate: float) -> list[dict[str, Any]]:
        """Return the optimiser's parameter groups."""
        groups: list[dict[str, Any]] = self._own("parameter_groups", super().parameter_groups, rate)
        with self.call("parameter_groups"):
            torch.optim.AdamW(groups)  # refuses what is no group here, where the fault has a name
        return groups

    def architecture(self) -> dict[str, Any]:
        """Return parameters and layers for the model card, what the network says of itself, and its fabrics."""
        counted = super().architecture()
        layers = {name.removeprefix("network."): shape for name, shape in counted["layers"].items()}
        own = self._own("architecture", dict)
        with self.call("architecture"):
            own = dict(own)
            json.dumps(own, allow_nan=False)
        return {**counted, "layers": layers, **own, "fabrics": [_about(fabric) for fabric in self.fabrics]}

    def _own(self, function: str, default: Callable[..., Any], *given: Any) -> Any:
        """Call a function of the network, or its default."""
        with self.call(function):
            return getattr(self.network, function, default)(*given)


def build_added(options: AddedMethod, fabrics: Sequence[Fabric]) -> GuardedNetwork:
    """Return an untrained network from outside.

    WorkFailed if the code is not the planned one; MethodFailed if it fails, or its function `network` returns none that
    can be trained.
    """
    make, root = imported(options)
    return _built(new(make, options, root), options, root, [_about(fabric) for fabric in fabrics])


def restore_added(options: AddedMethod, trained: Trained) -> Guarded:
    """Return the method from outside with its trained networks: one, or one a fabric.

    WorkFailed if the code is not the planned one; MethodFailed if it fails, or its network does not take the weights.
    """
    make, root = imported(options)
    methods = {}
    for card, weights in trained:
        method: Any = new(make, options, root)
        network = _built(method, options, root, card["architecture"]["fabrics"])
        with network.call("network"):
            network.load_state_dict(weights)
        with network.call("load"):
            method.load(network.network.eval())
        methods[fingerprint(network.fabrics[0].optics())] = method
    (*_, last) = methods.values()
    domain = domain_of([card for card, _ in trained])
    known = PerFabric(lambda fabric: methods.get(fingerprint(fabric.optics())))
    return Guarded(last, options, root, domain=domain, of=known.of if options.of_one_material else None)


def _about(fabric: Fabric) -> dict[str, Any]:
    return {"name": fabric.name, **fabric.optics()}


def _built(method: Any, options: AddedMethod, root: Path, about: Sequence[Mapping[str, Any]]) -> GuardedNetwork:
    """Return the network of a method for fabrics of these `_about`; MethodFailed if it cannot be trained."""
    fabrics = [_uncoloured(each) for each in about]
    with faults_of(options.name, "network", options.limit, root):
        network = method.network(list(fabrics))
    returned = f"network returned {type(network).__name__}"
    if not isinstance(network, nn.Module):
        raise MethodFailed(options.name, f"{returned}; a torch.nn.Module is needed")
    if not callable(getattr(network, "loss", None)):
        raise MethodFailed(options.name, f"{returned}, which lacks the function 'loss'")
    if not any(weight.requires_grad for weight in network.parameters()):
        raise MethodFailed(options.name, f"{returned}, which has nothing to train")
    return GuardedNetwork(network, options, root, fabrics)


def _uncoloured(about: Mapping[str, Any]) -> Fabric:
    """Return the fabric of `_about`, its diffuse colours black: legal at any optical thickness."""
    yarns = {key: about[key] | {"diffuse": (0.0, 0.0, 0.0)} for key in ("warp", "weft")}
    return Fabric.model_validate({**about, **yarns, "draft": Matrix(rows=tuple(about["draft"]))})
