"""Average error of the truth, from its standard errors.

The standard error of a tabulated answer is a cover: three of them exceed the true error for 99 of 100 queries. On
average the true error is smaller: over the nine fabrics of quick, 250 queries each, the stated variance of the colour
is 3.1 to 4.7 times the true one (plain weave 2.2, gabardine 12, all together 4.1; against 16,384 points a query and
more), on herringbone 3.4, on open cloth (gauze, organza, voile) 1.1 to 2. The true variance of the truth is subtracted
from a method's error, and so the stated variance is divided by a constant. The standard errors of sampled answers come
from independent randomisations and are taken as they are.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Answers, Queries

OVERSTATED: Final = 3.0
"""Stated over true variance of tabulated answers."""


def with_noise(answers: Answers, queries: Queries, options: TruthOptions) -> Answers:
    """Return the truth's answers with standard errors that are right on average."""
    if options.estimator not in ("node_table", "auto"):
        return answers
    # Curved cloth is sampled.
    share = np.where(queries.curvature > 0.0, 1.0, 1.0 / math.sqrt(OVERSTATED)).astype(np.float32)
    return answers._replace(
        standard_error=answers.standard_error * share[:, None],
        transparency_standard_error=answers.transparency_standard_error * share,
    )
