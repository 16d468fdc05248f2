"""The plain query, a round footprint of flat cloth lit from the viewer's side: all that some methods answer."""

from __future__ import annotations

import numpy as np

from pipeline.truth.query import Queries
from weaves.errors import BadInput

_ROUND = 1e-3  # of sigma, by which the axes of a round footprint may differ


def refuse_other(queries: Queries, method: str) -> None:
    """Refuse queries that are not plain: a BadInput that names the first row and column."""
    for name, rows, allowed in (
        ("wo", queries.wo[:, 2] < 0, "viewers in front of the cloth"),
        ("wi", queries.wi[:, 2] < 0, "light from the viewer's side"),
        (
            "sigma_minor",
            np.abs(queries.sigma_minor - queries.sigma) > _ROUND * queries.sigma,
            "round footprints (sigma_minor = sigma)",
        ),
        ("curvature", queries.curvature > 0, "flat cloth (curvature = 0)"),
    ):
        if rows.any():
            row = int(np.flatnonzero(rows)[0])
            value = getattr(queries, name)[row].tolist()
            raise BadInput("queries", f"{name}[{row}]", value, f"the method {method} answers {allowed} only")
