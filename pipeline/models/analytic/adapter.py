"""A method that learns nothing: tables of a fabric, made once, and a function that reads them."""

from collections.abc import Callable, Sequence
from typing import Any, ClassVar, Generic, TypeVar

from pipeline.compiled.arrays import Float32, nbytes
from pipeline.models.method import Method, refuse_other
from pipeline.models.options import Gaussian, Options
from pipeline.per_fabric import PerFabric
from pipeline.truth.query import Queries
from weaves.fabric import Fabric

Table = TypeVar("Table")


class AnalyticOptions(Options):
    """Options of a method that learns nothing."""

    learns: ClassVar[bool] = False

    footprint: Gaussian = "gaussian"
    parallax: bool = True
    """True if footprints are patches of view rays, or points view rays; must be that of the truth. A method that knows
    only one of both declares a `Literal`."""

    def methods(self) -> Sequence[Method]:
        """Return one method for each setting."""
        raise NotImplementedError


class Analytic(Generic[Table]):
    """A method that answers for any fabric, of the name and the kinds of queries that its options know.

    `k` is its setting, if it has settings; `tables` are those of each fabric, which methods of different settings may
    share. `read` answers N queries, float32 (N, 4), from the tables of a fabric; its third argument names random
    numbers. `stored` returns the bytes of the tables that a renderer stores.
    """

    def __init__(
        self,
        options: AnalyticOptions,
        k: int | None,
        tables: PerFabric[Table],
        read: Callable[[Table, Queries, int], Float32],
        stored: Callable[[Any], int] = nbytes,
    ) -> None:
        self.name, self.setting = options.name, "" if k is None else options.setting_of(k)
        self._kinds, self._tables, self._read, self._stored = options.kinds, tables, read, stored

    def covers(self, fabric: Fabric) -> bool:
        """Return True: any fabric has tables."""
        return True

    def prepare(self, fabric: Fabric) -> None:
        """Make the tables of the fabric, once."""
        self._tables.of(fabric)

    def predict(self, fabric: Fabric, queries: Queries, seed: int = 0) -> Float32:
        """Answer N queries, float32 (N, 4). BadInput for kinds of queries that it does not know."""
        refuse_other(queries, f"the method {self.name} answers", self._kinds)
        return self._answer(fabric, queries, seed)

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the bytes of the tables."""
        return self._stored(self._tables.of(fabric))

    def _answer(self, fabric: Fabric, queries: Queries, seed: int) -> Float32:
        """Answer queries of kinds that it knows."""
        return self._read(self._tables.of(fabric), queries, seed)
