"""The array types of kernels; any shape, contiguous unless a docstring says otherwise."""

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]


def nbytes(values: Iterable[object]) -> int:
    """Return the bytes of the arrays among these."""
    return sum(value.nbytes for value in values if isinstance(value, np.ndarray))
