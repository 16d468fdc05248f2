"""Calibration: standard errors and bounds of answers from the errors that an estimator itself reports.

Estimators report errors, and the meaning of a reported error differs between the computations, the *stages*: sampled
answers report the spread of randomisations, tables what they cannot resolve, quadrature the last change of its rules.
Each stage has factors, fitted on random fabrics (grid: tests/fits/fit_calibration.py), that give two numbers with one
meaning:

    standard error   s^2 = r^2 + (b m)^2, r = a e / (1 + a e / (c m)): the root mean square of the true errors over many
                     queries
    bound            k s: 99.7 % of the true errors of a component are smaller

with the reported error e and the norm m of the four components (for the transparency, m is 1). b is what may have been
missed of which nothing was seen. c limits reported errors: those of answers that have not converged are far too large.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float64, Mask
from pipeline.compiled.decorators import kernel
from pipeline.truth.cloth import Raw

COARSE_TABLE, FINE_TABLE, REFINED, SAMPLED, QUADRATURE, QUADRATURE_CURVED = range(6)
"""Stages: the two node tables, the fine one with refined nodes, sampling, quadrature of flat and of curved cloth."""


class Factors(NamedTuple):
    """Factors of a stage."""

    reported: float  # a, times the reported error
    largest: float  # c, the limit of reported errors, times the norm of the components
    missed: float  # b, times the norm of the components
    cover: float  # k, bound over standard error


FRONT_FACTORS: Final = {
    COARSE_TABLE: Factors(0.76, 0.03, 0.0019, 5.5),
    FINE_TABLE: Factors(0.67, 0.1, 0.0014, 8.5),
    REFINED: Factors(1.1, 0.1, 0.0005, 5.5),
    SAMPLED: Factors(1.0, math.inf, 0.0, 4.7),
    QUADRATURE: Factors(0.14, 0.3, 0.0015, 11.0),
    QUADRATURE_CURVED: Factors(0.17, 3.0, 0.001, 12.0),
}
"""Factors of the four components, light and viewer in front of the cloth."""

BEHIND_FACTORS: Final = FRONT_FACTORS | {
    COARSE_TABLE: Factors(0.8, 0.03, 0.002, 6.0),
    FINE_TABLE: Factors(0.8, 0.1, 0.0015, 10.0),
    REFINED: Factors(1.4, 0.1, 0.0005, 5.0),
    QUADRATURE: Factors(0.8, 0.2, 0.0035, 9.0),
    QUADRATURE_CURVED: Factors(0.8, 0.2, 0.0035, 9.0),
}
"""Factors of the four components, light or viewer behind the cloth: yarns are lit through gaps."""

TRANSPARENCY_FACTORS: Final = {
    COARSE_TABLE: Factors(0.8, math.inf, 0.0008, 7.0),
    FINE_TABLE: Factors(0.8, math.inf, 0.0003, 10.0),
    REFINED: Factors(0.5, math.inf, 0.0007, 8.0),
    SAMPLED: Factors(1.0, math.inf, 0.0, 4.7),
    QUADRATURE: Factors(0.14, math.inf, 0.0003, 10.0),
    QUADRATURE_CURVED: Factors(0.14, math.inf, 0.0003, 10.0),
}
"""Factors of the transparency."""


def calibrate(raw: Raw, behind: Mask) -> tuple[Float64, Float64]:
    """Return standard errors and bounds (N, 5); `behind` says which queries have light or viewer behind the cloth."""
    error, bound = np.zeros_like(raw.error), np.zeros_like(raw.error)
    size = np.linalg.norm(raw.mean[:, :4], axis=1)
    for table, chosen, columns in (
        (FRONT_FACTORS, ~behind, slice(4)),
        (BEHIND_FACTORS, behind, slice(4)),
        (TRANSPARENCY_FACTORS, np.ones_like(behind), slice(4, 5)),
    ):
        for stage, factors in table.items():
            here = np.flatnonzero(chosen & (raw.stage == stage))
            scale = size[here] if table is not TRANSPARENCY_FACTORS else (size[here] > 0.0).astype(np.float64)
            found = raw.error[here, columns]
            _calibrate_all(found, scale, factors)
            error[here, columns] = found
            bound[here, columns] = factors.cover * found
    return error, bound


@kernel
def squared_norm(components: Float64) -> float:
    """Return the sum of the squares of the four components; what follows them does not count."""
    total = 0.0
    for q in range(4):
        total += components[q] ** 2
    return total


@kernel
def standard_error(reported: float, size: float, factors: Factors) -> float:
    """Return the standard error of a component from the reported one; `size` is the norm of the components."""
    error = factors.reported * reported
    # A black answer has no scale: its error is that of the light that may have been missed.
    if size > 0.0:
        error /= 1.0 + error / (factors.largest * size)
    return math.hypot(error, factors.missed * size)


@kernel
def _calibrate_all(error: Float64, size: Float64, factors: Factors) -> None:
    """Replace reported errors (N, C) by standard errors."""
    for row in range(error.shape[0]):
        for column in range(error.shape[1]):
            error[row, column] = standard_error(error[row, column], size[row], factors)
