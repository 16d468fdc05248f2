"""Refusal of queries that some methods cannot answer: all but flat cloth, lit and seen from the front."""

from __future__ import annotations

import numpy as np

from pipeline.truth.query import Queries
from weaves.errors import BadInput

_ROUND = 1e-3  # of sigma, by which the axes of a round footprint may differ


def refuse_other(
    queries: Queries, method: str, stretch: bool = False, behind: bool = False, curvature: bool = False
) -> None:
    """Refuse queries that are not plain: a BadInput that names row and column.

    Footprints may be stretched with `stretch`, the light may come from behind with `behind`, and the cloth may be
    curved with `curvature`.
    """
    for name, rows, allowed in (
        ("wo", queries.wo[:, 2] < 0, "viewers in front of the cloth"),
        ("wi", (queries.wi[:, 2] < 0) & (not behind), "light from the viewer's side"),
        (
            "sigma_minor",
            (np.abs(queries.sigma_minor - queries.sigma) > _ROUND * queries.sigma) & (not stretch),
            "round footprints (sigma_minor = sigma)",
        ),
        ("curvature", (queries.curvature > 0) & (not curvature), "flat cloth (curvature = 0)"),
    ):
        if rows.any():
            row = int(np.flatnonzero(rows)[0])
            value = getattr(queries, name)[row].tolist()
            where = f"{int(rows.sum())} rows; first row {row}: {name}"
            raise BadInput("queries", where, value, f"the method {method} answers {allowed} only")
