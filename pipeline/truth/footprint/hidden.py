"""Patches of which the viewer sees hardly anything.

Where less than `HIDDEN_SHARE` of a patch's projected area is visible, the answer is 0 by definition. The share is an
estimate: near the limit, its error decides between 0 and a value, and this is part of the answer's error.
"""

from __future__ import annotations

import math
from typing import Final

from pipeline.compiled.arrays import Float64
from pipeline.compiled.decorators import kernel
from pipeline.truth.query import HIDDEN_SHARE

_CERTAIN: Final = 0.001
"""Probability of a wrong decision that is not worth more points."""


@kernel
def conceal(share: float, doubt: float, mean: Float64, error: Float64) -> bool:
    """Write the answer 0 for a patch that counts as hidden; where this is not certain, raise the error.

    Returns whether the decision may be wrong: such a patch is worth more points.

    Parameters
    ----------
    share, doubt : float
        Visible share of the patch's projected area, and its standard error.
    mean, error : float64 (5,)
        The answer of a patch that is not hidden.
    """
    concealed = share < HIDDEN_SHARE
    # Probability that the true share is on the other side of the limit, its error taken to be normal.
    distance = abs(share - HIDDEN_SHARE)
    wrong = 0.5 * math.erfc(distance / (math.sqrt(2.0) * doubt)) if doubt > 0.0 else 0.0
    for c in range(len(mean)):
        error[c] = math.hypot(0.0 if concealed else error[c], math.sqrt(wrong) * mean[c])
        if concealed:
            mean[c] = 0.0
    return wrong > _CERTAIN
