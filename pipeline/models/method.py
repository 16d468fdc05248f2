"""The interface of a method, which a benchmark measures: it evaluates queries on a fabric; arrays are NumPy."""

from collections.abc import Callable, Collection
from typing import Protocol, runtime_checkable

import numpy as np

from pipeline.compiled.arrays import Float32, Mask
from pipeline.truth.query import Queries
from weaves.errors import BadInput
from weaves.fabric import Fabric

CHUNK_ROWS = 4096
"""Rows of one inference on a CPU: activations of 128 numbers stay in the cache (half the time of 16,384 rows)."""

Read = Callable[[Queries], Float32]  # answers queries, in rows

_ROUND = 1e-3  # of sigma, by which the axes of a round footprint may differ


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

    def predict(self, fabric: Fabric, queries: Queries, seed: int = 0) -> Float32:
        """Return the components of N queries, float32 (N, 4), finite and >= 0; only random methods use `seed`."""

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the bytes that a renderer stores for this fabric."""


class Around:
    """A method around another one, which answers where a subclass does not; `words` join its setting."""

    def __init__(self, method: Method, *words: str) -> None:
        self.method, self.name = method, method.name
        self.setting = " ".join(filter(None, (method.setting, *words)))

    def covers(self, fabric: Fabric) -> bool:
        """Return whether the method covers a fabric."""
        return self.method.covers(fabric)

    def prepare(self, fabric: Fabric) -> None:
        """Prepare the method."""
        self.method.prepare(fabric)

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the method's bytes."""
        return self.method.bytes_stored(fabric)


def faults(queries: Queries, who: str, kinds: Collection[str] = ()) -> dict[int, tuple[str, object, str]]:
    """Return the fault of each query that is neither plain nor of some `kinds`: its column, value, and what is allowed.

    Plain queries are of flat cloth, round footprints, and lit from the front; others are of the kinds ``stretch``,
    ``behind`` and ``curvature``. `who` begins the sentence: "the method x answers".
    """
    stretched = np.abs(queries.sigma_minor - queries.sigma) > _ROUND * queries.sigma
    found: dict[int, tuple[str, object, str]] = {}
    for kind, name, strange, allowed in (
        ("", "wo", queries.wo[:, 2] < 0, "viewers in front of the cloth"),
        ("behind", "wi", queries.wi[:, 2] < 0, "light from the viewer's side"),
        ("stretch", "sigma_minor", stretched, "round footprints (sigma_minor = sigma)"),
        ("curvature", "curvature", queries.curvature > 0, "flat cloth (curvature = 0)"),
    ):
        if kind not in kinds and strange.any():
            values = getattr(queries, name)
            for row in np.flatnonzero(strange).tolist():
                found.setdefault(row, (name, values[row].tolist(), f"{who} {allowed} only"))
    return found


def refuse_other(queries: Queries, who: str, kinds: Collection[str] = ()) -> None:
    """Refuse queries with `faults`: a BadInput that names the first row and its column."""
    if found := faults(queries, who, kinds):
        row = min(found)
        column, value, allowed = found[row]
        raise BadInput("queries", f"{len(found)} rows; first row {row}: {column}", value, allowed)


def in_chunks(queries: Queries, read: Read, width: int = 4) -> Float32:
    """Return what is read for N queries, (N, width), `CHUNK_ROWS` rows at a time."""
    result = np.empty((len(queries.u), width), np.float32)
    for start in range(0, len(result), CHUNK_ROWS):
        rows = slice(start, start + CHUNK_ROWS)
        result[rows] = read(queries.take(rows))
    return result


def row_by_row(queries: Queries, chosen: Mask, one: Read, other: Read) -> Float32:
    """Answer the chosen queries in one way, the rest in another; neither is called without queries."""
    if not chosen.any():
        return other(queries)
    answers = one(queries.take(chosen))
    if chosen.all():
        return answers
    result = np.empty((len(chosen), *answers.shape[1:]), np.float32)
    result[chosen], result[~chosen] = answers, other(queries.take(~chosen))
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
