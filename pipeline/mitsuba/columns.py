"""Values of Mitsuba as NumPy arrays with one row a ray, and back, for scalar and for vectorised variants."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.compiled.arrays import Float64, Index, Mask


class Columns:
    """Values of one variant of Mitsuba.

    Parameters
    ----------
    mi : module
        Mitsuba, its variant set.
    count : int
        Rays; 1 where the variant is scalar.
    """

    def __init__(self, mi: Any, count: int) -> None:
        self._mi, self._count = mi, count
        self._scalar = mi.variant().startswith("scalar")

    def number(self, value: Any) -> Float64:
        """Return a number of each ray, (N,)."""
        return np.broadcast_to(np.asarray(value, np.float64).reshape(-1), (self._count,))

    def vector(self, value: Any) -> Float64:
        """Return the vector of each ray, (N, its length)."""
        rows = np.asarray(value, np.float64)
        rows = rows.reshape(len(rows), -1).T
        return np.broadcast_to(rows, (self._count, rows.shape[1]))

    def active(self, value: Any) -> Index:
        """Return which rays are active."""
        chosen: Mask = np.broadcast_to(np.asarray(value, np.bool_).reshape(-1), (self._count,))
        return np.flatnonzero(chosen)

    def to_mitsuba(self, kind: Any, values: Any, rows: Index, elsewhere: float = 0.0) -> Any:
        """Return numbers (n,) or vectors (n, c) of the rays `rows` as Mitsuba's `kind`; other rays have `elsewhere`."""
        values = np.asarray(values)
        if self._scalar:
            if values.ndim == 1:
                return kind(values[0].item() if len(rows) else elsewhere)
            return kind(*(values[0].tolist() if len(rows) else [elsewhere] * values.shape[1]))
        type_of = np.uint32 if kind is self._mi.UInt32 else np.bool_ if kind is self._mi.Bool else np.float32
        whole = np.full((self._count, *values.shape[1:]), elsewhere, type_of)
        whole[rows] = values
        return kind(np.ascontiguousarray(whole.T))
