"""Result of a check: a number agrees with its expected value exactly, within its statistical error, or not.

A number without statistical error passes if it equals its expected value up to rounding. Many numbers with errors pass
if Student's t of the worst stays below the quantile of `LEVEL`, with Sidak's correction for their number.
"""

from __future__ import annotations

from typing import Final, Literal, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import stats

from pipeline.compiled.arrays import Float64

LEVEL: Final = 1e-4
"""Probability that a check fails although the invariant holds."""

ROUNDING: Final = 2e-6
"""Relative error of a few operations on answers in single precision."""


class CheckResult(NamedTuple):
    """A measured number, its expected value, and whether both agree.

    Attributes
    ----------
    name : str
        Measured quantity.
    measured, expected, standard_error : float
        Measured number, expected value, and standard error, which is 0 for an exact number.
    relation : str
        Expected relation of the number to the expected value; ``reported``: there is no expected value.
    status : str
        ``exact``, ``statistics`` (holds within its uncertainty), ``broken`` or ``reported``.
    note : str
        Remark, shown in the table.
    """

    name: str
    measured: float
    expected: float
    standard_error: float
    relation: Literal["=", "<=", "reported"]
    status: Literal["exact", "statistics", "broken", "reported"]
    note: str

    @property
    def sigmas(self) -> float:
        """Distance from the expected value in standard errors; 0 for an exact number."""
        return (self.measured - self.expected) / self.standard_error if self.standard_error else 0.0


def exact(
    name: str, measured: float, expected: float, tolerance: float, relation: Literal["=", "<="] = "=", note: str = ""
) -> CheckResult:
    """Check a number without statistical error; NaN is broken."""
    beyond = measured - expected if relation == "<=" else abs(measured - expected)
    return CheckResult(name, measured, expected, 0.0, relation, "exact" if beyond <= tolerance else "broken", note)


def worst(
    name: str,
    measured: npt.ArrayLike,
    expected: float,
    errors: npt.ArrayLike,
    freedom: int,
    relation: Literal["=", "<="] = "=",
    note: str = "",
) -> CheckResult:
    """Check many numbers; the result is that of the number furthest off, in its standard errors.

    Parameters
    ----------
    measured, errors : float (N,)
        The numbers and their standard errors.
    freedom : int
        Degrees of freedom of the errors.
    """
    values, spread = np.broadcast_arrays(np.atleast_1d(np.asarray(measured, np.float64)), np.asarray(errors))
    # Rounding counts as error too: two sums of the same points differ by it and by nothing else.
    beyond = (values - expected) / (spread + ROUNDING * max(abs(expected), 1e-3))
    score = beyond if relation == "<=" else np.abs(beyond)
    row = int(np.argmax(np.where(np.isnan(score), np.inf, score)))
    level = 1.0 - (1.0 - LEVEL) ** (1.0 / len(values))
    limit = float(stats.t.isf(level if relation == "<=" else level / 2.0, freedom))
    holds = bool(score[row] <= limit)
    note = note or (f"worst of {len(values)}, limit {limit:.1f} σ" if len(values) > 1 else "")
    status: Literal["statistics", "broken"] = "statistics" if holds else "broken"
    return CheckResult(name, float(values[row]), expected, float(spread[row]), relation, status, note)


def quotient(first: npt.ArrayLike, second: npt.ArrayLike) -> Float64:
    """Return first / second, and 1 where they are equal, 0 / 0 included."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(np.equal(first, second), 1.0, np.divide(first, second, dtype=np.float64))


def largest(values: Float64) -> float:
    """Return the greatest modulus; NaN if there is one."""
    return float(np.abs(values).max())
