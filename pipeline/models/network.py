"""Networks: `Trainable`, which the training loop trains, and `NetworkMethod`, which a trained one answers by.

Batches are torch tensors. A fabric is encoded once; the rest of a network maps a few numbers of each query and of the
fabric to the four components (`PerQuery`). As a separate module it can be compiled, exported or quantised
(`pipeline.models.runtimes`) without a new training.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any, ClassVar, Final, Generic, NamedTuple, Protocol, TypeVar, runtime_checkable

import numpy as np
import torch
from torch import Tensor, nn

from pipeline.compiled.arrays import Float32
from pipeline.fingerprint import fingerprint
from pipeline.models.domain import Domain, domain_of
from pipeline.models.method import Method, in_chunks, in_repeat
from pipeline.models.options import Options
from pipeline.per_fabric import PerFabric
from pipeline.truth.query import Queries
from weaves.fabric import Fabric

Trained = Sequence[tuple[dict[str, Any], dict[str, Tensor]]]  # cards and weights of trained models

Columns = tuple[Float32, ...]  # arrays of N rows

_ANY: Final = ""  # key of a network that answers for any fabric


class Batch(NamedTuple):
    """Queries and targets of a training step: F fabrics, n queries each."""

    fabric: Tensor  # index into the fabrics the network was built for, int64 (F,)
    u: Tensor
    v: Tensor
    sigma: Tensor
    """Footprint, in yarn spacings, float32 (F, n)."""
    wi: Tensor
    wo: Tensor
    """Directions, float32 (F, n, 3)."""
    sigma_minor: Tensor
    angle: Tensor
    curvature: Tensor
    """The rest of the query, as in `Queries`, float32 (F, n)."""
    target: Tensor  # components, float32 (F, n, 4)
    transparency: Tensor  # share of light from straight behind that passes unscattered, float32 (F, n)


class Trainable(nn.Module):
    """A network that the training loop trains; subclasses have a `loss`, and the rest as far as they need it."""

    def loss(self, batch: Batch, random: np.random.Generator) -> Tensor:
        """Return the loss of a batch; `random` is a pure function of seed and step."""
        raise NotImplementedError

    def start_at(self, target: Tensor) -> None:
        """Set the last bias to the mean of targets (M, 4): a leaky ReLU can stall far from it."""

    def schedule(self, progress: float) -> None:
        """Adjust scheduled parameters at `progress` in [0, 1)."""

    def parameter_groups(self, rate: float) -> list[dict[str, Any]]:
        """Return the optimiser's parameter groups with their peak learning rates: one, if nothing else is said."""
        return [{"params": list(self.parameters()), "lr": rate}]

    def counts(self) -> dict[str, int]:
        """Return the numbers of parameters of the network's parts."""
        return {}

    def architecture(self) -> dict[str, Any]:
        """Describe layers and parameter counts for the model card."""
        layers = {name: list(weight.shape) for name, weight in self.named_parameters()}
        total = sum(weight.numel() for weight in self.parameters())
        return {"parameters": {**self.counts(), "total": total}, "layers": layers}

    def call(self, function: str) -> AbstractContextManager[None]:
        """Return the guard of a call of one of its functions; it does nothing for a network of the package."""
        return nullcontext()


class QueryNetwork(Trainable):
    """A network that answers each query by itself, from what it makes of a fabric once."""

    options: Any  # the design, with the method's name
    columns: ClassVar[tuple[str, ...]] = ("u", "v", "sigma", "wi", "wo")
    """Columns of the queries that it reads, centres as shares of the repeat; here those of round footprints of flat
    cloth, the inputs of the published networks."""

    def encoded(self, fabric: Fabric) -> tuple[Tensor, ...]:
        """Return all that is computed once for a fabric, the constants of its queries; nothing by default."""
        return ()

    def components(self, *inputs: Tensor) -> Tensor:
        """Return components (N, 4) from the columns of N queries and the constants of a fabric."""
        raise NotImplementedError

    def stored(self, constants: tuple[Tensor, ...]) -> int:
        """Return how many numbers a renderer stores for a fabric with these constants; all weights by default."""
        return sum(weight.numel() for weight in self.parameters())


Net = TypeVar("Net", bound=QueryNetwork)
Learnt = TypeVar("Learnt", bound=Trainable)


class PerQuery(NamedTuple):
    """Computation of a method for each query of one fabric."""

    refuse: Callable[[Queries], None]  # raises BadInput for queries outside the domain
    inputs: Callable[[Queries], Columns]  # returns the inputs of the module for N queries: float32 arrays of N rows
    module: nn.Module  # takes the inputs, as tensors, then the constants; returns the components (N, 4)
    constants: tuple[Tensor, ...] = ()
    """Inputs of the module for the fabric. Fabrics whose constants have equal shapes may share the module."""

    def answered(self, queries: Queries, run: Callable[..., Tensor] | None = None, width: int = 4) -> Float32:
        """Return the components of N queries, (N, 4), by the module; or what runs in its place returns, (N, width)."""
        self.refuse(queries)
        run = run or self.module

        def read(part: Queries) -> Float32:
            return run(*map(torch.from_numpy, self.inputs(part)), *self.constants).numpy()

        with torch.inference_mode():
            return in_chunks(queries, read, width)


@runtime_checkable
class Portable(Method, Protocol):
    """A method that can be run in other ways."""

    def per_query(self, fabric: Fabric) -> PerQuery:
        """Return its part that runs for every query of a fabric that it covers."""


class Answering(nn.Module):
    """A function from inputs and constants to components (N, 4), with the network whose weights it reads."""

    def __init__(self, network: nn.Module, answer: Callable[..., Tensor]) -> None:
        super().__init__()
        self.network = network.eval()
        self._answer = answer
        self.eval()

    def forward(self, *given: Tensor) -> Tensor:
        """Answer N queries."""
        return self._answer(*given)


@contextmanager
def one_thread() -> Iterator[None]:
    """Let torch compute on the thread that calls it, for callers that have one thread a core themselves."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)


class NetworkMethod(Generic[Net]):
    """Trained networks as a method: one that answers for any fabric, or one for each fabric.

    `networks` is one network, or from the fingerprint of a fabric's optics to its network. Without the `domain` of the
    training, any query is answered.
    """

    def __init__(self, networks: Net | Mapping[str, Net], domain: Domain | None = None) -> None:
        self._networks = networks if isinstance(networks, Mapping) else {_ANY: networks}
        self._modules = {key: Answering(network, network.components) for key, network in self._networks.items()}
        self.options = next(iter(self._networks.values())).options
        self.name, self.setting, self.domain = self.options.name, "", domain
        self._parts = PerFabric(self._encoded)

    def covers(self, fabric: Fabric) -> bool:
        """Return whether a network was trained for any fabric, or for this one."""
        return self._key(fabric) in self._networks

    def prepare(self, fabric: Fabric) -> None:
        """Encode the fabric, once."""
        self._parts.of(fabric)

    def predict(self, fabric: Fabric, queries: Queries, seed: int = 0) -> Float32:
        """Answer N queries, float32 (N, 4); `seed` is not used. BadInput for kinds of queries not trained on."""
        return self._parts.of(fabric).answered(queries)

    def per_query(self, fabric: Fabric) -> PerQuery:
        """Return the part that runs for every query; all fabrics of a network share its module."""
        return self._parts.of(fabric)

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the bytes of what a renderer needs of the network, and of what it made of the fabric, float32."""
        return 4 * self.network_of(fabric).stored(self._parts.of(fabric).constants)

    def network_of(self, fabric: Fabric) -> Net:
        """Return the network of a fabric that is covered."""
        return self._networks[self._key(fabric)]

    def refuse(self, queries: Queries) -> None:
        """Refuse queries of kinds not trained on."""
        if self.domain is not None:
            self.domain.refuse(queries, self.name)

    def _key(self, fabric: Fabric) -> str:
        return _ANY if _ANY in self._networks else fingerprint(fabric.optics())

    def _encoded(self, fabric: Fabric) -> PerQuery:
        with torch.no_grad():
            return self._part(fabric, self.network_of(fabric).encoded(fabric))

    def _part(self, fabric: Fabric, constants: tuple[Tensor, ...]) -> PerQuery:
        """Return the part for queries about a fabric with these constants."""
        module, names, repeat = self._modules[self._key(fabric)], self.network_of(fabric).columns, fabric.weave.repeat

        def inputs(queries: Queries) -> Columns:
            near = in_repeat(queries, repeat)
            return tuple(np.array(getattr(near, name), np.float32) for name in names)

        return PerQuery(self.refuse, inputs, module, constants)


def restored(
    options: Options, trained: Trained, make: Callable[[tuple[int, int]], Learnt]
) -> tuple[dict[str, Learnt], Domain | None]:
    """Return what a `NetworkMethod` is made of: networks and their joint domain; RuntimeError if weights do not fit.

    `make` returns an untrained network; a network of one material is made for the repeat (ends, picks) of its fabric.
    """
    networks = {}
    for card, weights in trained:
        key, (ends, picks) = _ANY, (0, 0)
        if options.of_one_material:
            (fabric,) = card["fabrics"]
            key, (ends, picks) = fabric["optics"], fabric["repeat"]
        networks[key] = make((ends, picks))
        networks[key].load_state_dict(weights)
    return networks, domain_of([card for card, _ in trained])
