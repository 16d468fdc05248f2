"""Findings: an expression of the model over corner inputs, and how far rounding takes it from the reference.

Every expression is computed over corner inputs, in the form that the package uses and, where there is one, in the form
of the textbook. It holds if its worst relative error is at most `SLACK` times the figure listed for it, if no value is
NaN or infinite, and if none is negative. The figures listed for single precision were measured once, elsewhere; those
for double precision are the same times 2^-29, the ratio of the two arithmetics.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Final

import numpy as np
import numpy.typing as npt

from pipeline.compiled.arrays import Float64, Mask
from reports.truth.row_records import RowRecords

SLACK: Final = 2.0  # how far beyond the listed figure a worst error may lie: it is an extreme of random corners
DOUBLE: Final = 2.0**-29  # rounding of float64 over that of float32
ILL: Final = "ill-conditioned"  # ending of the corners in which the rounding of the input alone makes the error

Array = npt.NDArray[Any]


@dataclass(frozen=True)
class Finding:
    """One expression over one set of corners."""

    expression: str
    corner: str  # over which inputs
    arithmetic: str  # float32 or float64: what computes it; the next better one is the reference
    count: int  # inputs
    worst: Annotated[float, "worst_error"]  # relative, of the finite values
    at: str  # the input that did it
    listed: Annotated[float, "listed_error"]  # the error this form is known to make
    not_finite: Annotated[int, "not_finite"]  # values that are NaN or infinite
    negative: Annotated[int, "negative"]  # values below 0 where none can be
    naive: Annotated[float, "naive_error"] = math.nan  # of the textbook's form; NaN if there is none
    naive_not_finite: Annotated[int, "naive_not_finite"] = 0  # how often that one is NaN or infinite

    @property
    def holds(self) -> bool:
        """True if there is no fault."""
        return not self.fault

    @property
    def fault(self) -> str:
        """Description of the fault; empty if there is none."""
        if self.not_finite:
            return f"{self.not_finite} of {self.count} values are NaN or infinite"
        if self.negative:
            return f"{self.negative} of {self.count} values are negative"
        limit = SLACK * self.listed
        return f"worst error {self.worst:.1e}, beyond the limit {limit:.1e}" if self.worst > limit else ""


def judge(
    expression: str,
    corner: str,
    arithmetic: str,
    inputs: Mapping[str, npt.ArrayLike],
    value: npt.ArrayLike,
    reference: npt.ArrayLike,
    listed: float,
    naive: npt.ArrayLike | None = None,
    floor: float = 0.0,
    signed: bool = False,
    absolute: bool = False,
) -> Finding:
    """Compare values with their reference; other parameters are fields of `Finding`.

    `inputs` has name and values (N,) or (3, N) of what the N corners differ in. `value`, `reference` and `naive`, (N,)
    or (N, k), are what was computed, what it should be, and the textbook's form; objects of 50 digits are welcome. Of k
    numbers the length of the error vector over that of the reference counts. `floor` is the size below which the
    reference counts as this large. Values may be negative if `signed`; `absolute` errors are not divided.
    """
    error, finite = _errors(value, reference, floor, absolute)
    negative = finite & ~np.bool_(signed) & (np.asarray(value, np.float64) < 0).reshape(len(finite), -1).any(axis=1)
    # What cannot be at all comes before what is merely wrong.
    impossible = ~finite | negative
    row = int(impossible.argmax() if impossible.any() else error.argmax())
    textbook: dict[str, Any] = {}
    if naive is not None:
        naive_error, naive_finite = _errors(naive, reference, floor, absolute)
        textbook = {"naive": float(naive_error.max()), "naive_not_finite": int((~naive_finite).sum())}
    return Finding(
        expression=expression,
        corner=corner,
        arithmetic=arithmetic,
        count=len(error),
        worst=float(error.max()),
        at=", ".join(f"{name} {_word(np.asarray(column).T[row])}" for name, column in inputs.items()),
        listed=listed,
        not_finite=int((~finite).sum()),
        negative=int(negative.sum()),
        **textbook,
    )


def _errors(value: npt.ArrayLike, reference: npt.ArrayLike, floor: float, absolute: bool) -> tuple[Float64, Mask]:
    """Return relative errors (N,) in the better of both arithmetics, 0 of what is not finite; and what is finite."""
    truth, good = np.asarray(reference), np.isfinite(np.asarray(value, np.float64))
    values = np.where(good, value, 0.0)
    if truth.dtype == object:
        from reports.truth.formulas import exact

        values = exact(values)
    else:
        values, truth = values.astype(np.float64), truth.astype(np.float64)
    finite = np.asarray(good.reshape(len(good), -1).all(axis=1))
    difference = np.abs(np.asarray(values - truth)).reshape(len(truth), -1)
    size = np.abs(truth).reshape(len(truth), -1)
    if difference.shape[1] > 1:
        difference, size = (np.sqrt((part * part).sum(axis=1, keepdims=True)) for part in (difference, size))
    if not absolute:
        # Where the truth is 0, so must be the value.
        nothing = np.equal(size, 0).astype(np.bool_)
        difference = difference / np.where(np.less(size, floor).astype(np.bool_), floor, np.where(nothing, 1, size))
    return np.where(finite, np.asarray(difference[:, 0], np.float64), 0.0), finite


RECORDS: Final = RowRecords(Finding, setting=("expression", "corner"), method_field="arithmetic", once={"note": "at"})


def _word(value: Any) -> str:
    """Write an input with the digits that matter."""
    if isinstance(value, str | np.str_):
        return str(value)
    return f"({' '.join(map(_word, value))})" if np.ndim(value) else f"{float(value):.7g}"
