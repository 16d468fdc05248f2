"""The part of a trained method that runs for every query.

A fabric is encoded once; the rest maps a few numbers of each query and of the fabric to the four components. As a
separate module it can be compiled, exported or quantised (`pipeline.models.runtimes`) without a new training.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt
from torch import Tensor, nn

from pipeline.models.method import KNOWN, Method
from pipeline.truth.query import Queries
from weaves.fabric import Fabric

Columns = tuple[npt.NDArray[np.float32], ...]
"""Arrays of N rows."""


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
