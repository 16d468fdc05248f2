"""The training of a model, for a descriptor."""

from __future__ import annotations

from pipeline.models.domain import Domain
from weaves.errors import BadInput
from weaves.fabric import Fabric


def trained_ranges(domain: Domain | None) -> dict[str, tuple[float, float]]:
    """Return the ranges of footprints, directions and yarns that a model was trained on."""
    if domain is None:
        return {}
    queries = domain.queries
    of_queries = {"footprint, yarn spacings": queries.sigma, "angle to the normal, degrees": (0.0, queries.max_angle)}
    return of_queries | domain.yarns


def why_outside(domain: Domain | None, fabric: Fabric) -> str:
    """Return which yarn of a fabric lies outside the training, such as ``optical_thickness = 0.8``; empty if none."""
    if domain is None:
        return ""
    try:
        domain.refuse_fabric(fabric, "")
    except BadInput as error:
        return f"{error.key} = {error.value}"
    return ""
