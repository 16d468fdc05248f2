"""Interfaces: `Method`, which a benchmark measures, and `Network`, which the training loop trains.

A Method evaluates queries on a fabric; arrays are NumPy. A Network is the trainable part of a method; its batches are
torch tensors.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple, Protocol, TypeVar, runtime_checkable

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn

from pipeline.truth.query import Queries
from weaves.fabric import Fabric

CHUNK = 4096
"""Rows of one inference on a CPU: activations of 128 numbers stay in the cache (half the time of 16,384 rows)."""

GPU_CHUNK = 2**18
"""Rows of one inference on a GPU."""

KNOWN = ("u", "v", "sigma", "wi", "wo")
"""Columns of round footprints of flat cloth, the inputs of the published networks."""

Trained = Sequence[tuple[dict[str, Any], dict[str, Tensor]]]
"""Cards and weights of trained models."""

Net = TypeVar("Net", bound=nn.Module)


@runtime_checkable
class Method(Protocol):
    """Evaluation of queries on a fabric."""

    @property
    def name(self) -> str:
        """Name of the method, as the recipe names it."""

    @property
    def setting(self) -> str:
        """Variant of the method, such as ``"k = 2"``; may be empty."""

    def covers(self, fabric: Fabric) -> bool:
        """Return whether the method covers a fabric."""

    def prepare(self, fabric: Fabric) -> None:
        """Precompute tables or latents of a fabric, as a renderer does when it is loaded; not part of query times."""

    def predict(self, fabric: Fabric, queries: Queries, seed: int = 0) -> npt.NDArray[np.float32]:
        """Return the components of N queries, float32 (N, 4), finite and >= 0; only random methods use `seed`."""

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the bytes that a renderer stores for this fabric."""


@runtime_checkable
class EstimatesErrors(Method, Protocol):
    """A method that estimates the errors of its answers."""

    def within(self, error: float) -> Method:
        """Return the method at a wished relative error, above 0 and below 1: other answers where it is exceeded."""


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


class Network(Protocol):
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
    chunk = CHUNK if device.type == "cpu" else GPU_CHUNK
    with torch.inference_mode():
        for start in range(0, len(result), chunk):
            rows = slice(start, start + chunk)
            # A copy: torch cannot hold arrays that are read-only, as those of a mapped file are.
            tensors = [torch.from_numpy(np.array(column[rows], np.float32)).to(device) for column in arrays]
            result[rows] = answer(*tensors).numpy(force=True)
    return result


def in_repeat(queries: Queries, repeat: tuple[int, int]) -> Queries:
    """Return the queries with centres as shares of the repeat, in [0, 1).

    Reduced in float64: float32 shares of a far centre would have lost the position within the repeat.
    """
    shares = []
    for position, period in zip((queries.u, queries.v), repeat, strict=True):
        share = (np.mod(position.astype(np.float64), period) / period).astype(np.float32)
        shares.append(np.where(share < 1.0, share, np.float32(0.0)))  # rounding to float32 can reach 1
    return queries._replace(u=shares[0], v=shares[1])
