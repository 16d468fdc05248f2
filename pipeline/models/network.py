"""Interfaces of networks: `Trainable`, which the training loop trains, and `PerQuery`, which runs for every query.

Batches are torch tensors. A fabric is encoded once; the rest of a network maps a few numbers of each query and of the
fabric to the four components. As a separate module it can be compiled, exported or quantised
(`pipeline.models.runtimes`) without a new training.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple, Protocol, TypeVar, runtime_checkable

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn

from pipeline.models.method import CHUNK_ROWS, Method
from pipeline.truth.query import Queries
from weaves.fabric import Fabric

GPU_CHUNK = 2**18
"""Rows of one inference on a GPU."""

KNOWN = ("u", "v", "sigma", "wi", "wo")
"""Columns of round footprints of flat cloth, the inputs of the published networks."""

Trained = Sequence[tuple[dict[str, Any], dict[str, Tensor]]]
"""Cards and weights of trained models."""

Net = TypeVar("Net", bound=nn.Module)

Columns = tuple[npt.NDArray[np.float32], ...]
"""Arrays of N rows."""


class Batch(NamedTuple):
    """Queries and targets of a training step: F fabrics, n queries each.

    Attributes
    ----------
    fabric : int64 (F,)
        Index into the fabrics the network was built for.
    u, v, sigma : float32 (F, n)
        Footprint, in yarn spacings.
    wi, wo : float32 (F, n, 3)
        Directions.
    sigma_minor, angle, curvature : float32 (F, n)
        The rest of the query, as in `Queries`.
    target : float32 (F, n, 4)
        Components.
    transparency : float32 (F, n)
        Share of light from straight behind that passes unscattered.
    """

    fabric: Tensor
    u: Tensor
    v: Tensor
    sigma: Tensor
    wi: Tensor
    wo: Tensor
    sigma_minor: Tensor
    angle: Tensor
    curvature: Tensor
    target: Tensor
    transparency: Tensor


class Trainable(Protocol):
    """A torch module that the training loop can train; the module's file describes what it learns.

    A network from outside needs `loss` alone (`pipeline.models.added.network`).
    """

    def loss(self, batch: Batch, random: np.random.Generator) -> Tensor:
        """Return the loss of a batch; `random` is a pure function of seed and step."""

    def start_at(self, target: Tensor) -> None:
        """Set the last bias to the mean of targets (M, 4): a leaky ReLU can stall far from it."""

    def schedule(self, progress: float) -> None:
        """Adjust scheduled parameters at `progress` in [0, 1)."""

    def parameter_groups(self, rate: float) -> list[dict[str, Any]]:
        """Return the optimiser's parameter groups with their peak learning rates."""

    def architecture(self) -> dict[str, Any]:
        """Describe layers and parameter counts for the model card."""


class PerQuery(NamedTuple):
    """Computation of a method for each query of one fabric."""

    refuse: Callable[[Queries], None]
    """Raises BadInput for queries outside the domain."""
    inputs: Callable[[Queries], Columns]
    """Returns the inputs of the module for N queries: float32 arrays of N rows."""
    module: nn.Module
    """Takes the inputs, as tensors, then the constants; returns the components (N, 4)."""
    constants: tuple[Tensor, ...] = ()
    """Inputs of the module for the fabric. Fabrics whose constants have equal shapes may share the module."""


@runtime_checkable
class Portable(Method, Protocol):
    """A method that can be run in other ways."""

    def per_query(self, fabric: Fabric) -> PerQuery:
        """Return its part that runs for every query of a fabric that it covers."""


class Answering(nn.Module):
    """A function of tensors, with the network whose weights it reads.

    Parameters
    ----------
    network : nn.Module
        Holds the weights.
    answer : callable
        From inputs and constants to components (N, 4).
    """

    def __init__(self, network: nn.Module, answer: Callable[..., Tensor]) -> None:
        super().__init__()
        self.network = network.eval()
        self._answer = answer
        self.eval()

    def forward(self, *given: Tensor) -> Tensor:
        """Answer N queries."""
        return self._answer(*given)


def columns_of(queries: Queries, names: Sequence[str] = KNOWN) -> Columns:
    """Return columns of queries by their names."""
    return tuple(np.array(getattr(queries, name), np.float32) for name in names)


@contextmanager
def one_thread() -> Iterator[None]:
    """Let torch compute on the thread that calls it, for callers that have one thread a core themselves."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def loaded(network: Net, weights: dict[str, Tensor]) -> Net:
    """Return a network with these weights; RuntimeError if they do not fit."""
    network.load_state_dict(weights)
    return network


def in_chunks(
    queries: Queries,
    answer: Callable[..., Tensor],
    device: torch.device,
    columns: Sequence[str] = KNOWN,
    width: int = 4,
) -> npt.NDArray[np.float32]:
    """Evaluate queries in chunks, without gradients.

    Parameters
    ----------
    queries : Queries
        N queries.
    answer : callable
        Takes the columns as float32 tensors (rows,) or (rows, 3) on `device`; returns (rows, width).
    device : torch.device
        Device of `answer`.
    columns : sequence of str
        Columns that `answer` takes.
    width : int
        Values per query.

    Returns
    -------
    float32 (N, width)
    """
    result = np.empty((len(queries.u), width), np.float32)
    arrays = [getattr(queries, name) for name in columns]
    chunk = CHUNK_ROWS if device.type == "cpu" else GPU_CHUNK
    with torch.inference_mode():
        for start in range(0, len(result), chunk):
            rows = slice(start, start + chunk)
            # A copy: torch cannot hold arrays that are read-only, as those of a mapped file are.
            tensors = [torch.from_numpy(np.array(column[rows], np.float32)).to(device) for column in arrays]
            result[rows] = answer(*tensors).numpy(force=True)
    return result
