"""What a trained model was taught: kinds of questions and cloths outside of it are refused, never guessed at.

The domain is on the model card. Within a kind that it knows a model is asked beyond the trained ranges: larger
footprints are the average of the repeat, smaller ones nearly points, and grazing angles are close to those it saw.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np
from pydantic import BaseModel, ConfigDict

from pipeline.shards.queries import QueryOptions
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from weaves.errors import BadInput
from weaves.fabric import Fabric

PHYSICS: Final = ("footprint", "frame", "normaliser", "geometry", "shadows", "variation")
"""Options of the truth that decide what is learnt, not how exactly."""

_YARN: Final = ("roughness", "bend", "twist", "relief", "width", "blend")
_SLACK: Final = 0.02  # of a range, that a fabric may lie outside


class Domain(BaseModel):
    """Queries, physics and yarns that a model was trained on."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    queries: QueryOptions
    """Distribution of the questions."""
    physics: dict[str, Any]
    """Options of the truth named in `PHYSICS`."""
    yarns: dict[str, tuple[float, float]]
    """Range of each parameter over the yarns of all trained fabrics, and of the optical thickness."""

    @classmethod
    def of(cls, about: Mapping[str, Any], fabrics: Sequence[Fabric]) -> Domain:
        """Return the domain of a data set, from its manifest's `about` and the fabrics trained on."""
        truth = TruthOptions.model_validate(about.get("truth", {})).model_dump(mode="json")
        numbers = [_numbers(fabric) for fabric in fabrics]
        return cls(
            queries=QueryOptions.model_validate(about.get("queries", {})),
            physics={name: truth[name] for name in PHYSICS},
            yarns={
                name: (min(min(n[name]) for n in numbers), max(max(n[name]) for n in numbers)) for name in numbers[0]
            },
        )

    def with_yarns(self, other: Domain) -> Domain:
        """Return this domain with ranges of yarns that hold those of another one too."""
        both = {name: (*own, *other.yarns[name]) for name, own in self.yarns.items()}
        return self.model_copy(update={"yarns": {name: (min(ends), max(ends)) for name, ends in both.items()}})

    def refuse(self, queries: Queries, model: str) -> None:
        """Refuse queries of a kind that the model never saw: a BadInput that names the first row and column."""
        if found := self.faults(queries, model):
            row = min(found)
            column, value, allowed = found[row]
            raise BadInput("queries", f"{len(found)} rows; first row {row}: {column}", value, allowed)

    def faults(self, queries: Queries, model: str) -> dict[int, tuple[str, object, str]]:
        """Return the queries it was not taught, as `pipeline.truth.query.faults` does those that have no answer."""
        found: dict[int, tuple[str, object, str]] = {}
        for rows, column, values, allowed in self._strangers(queries):
            for row in np.flatnonzero(rows).tolist():
                found.setdefault(row, (column, values[row].tolist(), f"the model {model} was trained {allowed} only"))
        return found

    def refuse_fabric(self, fabric: Fabric, model: str) -> None:
        """Refuse a fabric whose yarns lie outside those trained on."""
        for name, values in _numbers(fabric).items():
            low, high = self.yarns[name]
            slack = _SLACK * (high - low) + 1e-6
            for value in values:
                if not low - slack <= value <= high + slack:
                    allowed = f"the model {model} was trained on {low:g} to {high:g} only; --extrapolate asks it anyway"
                    raise BadInput(fabric.name, name, value, allowed)

    def knows(self, fabric: Fabric) -> bool:
        """Tell whether a fabric's yarns lie within those trained on."""
        try:
            self.refuse_fabric(fabric, "")
        except BadInput:
            return False
        return True

    def refuse_truth(self, truth: TruthOptions, model: str) -> None:
        """Refuse a truth of other physics than the model's own."""
        theirs = truth.model_dump(mode="json")
        for name, own in self.physics.items():
            if theirs[name] != own:
                raise BadInput("truth", name, theirs[name], f"the model {model} was trained with {name} = {own!r}")

    def _strangers(self, queries: Queries) -> Iterator[tuple[Any, str, Any, str]]:
        yield queries.wo[:, 2] < 0, "wo", queries.wo, "for viewers in front of the cloth"
        if self.queries.behind == 0.0:
            yield queries.wi[:, 2] < 0, "wi", queries.wi, "for light from the viewer's side"
        if self.queries.stretch == 1.0:
            stretched = np.abs(queries.sigma_minor - queries.sigma) > 1e-3 * queries.sigma
            yield stretched, "sigma_minor", queries.sigma_minor, "for round footprints (sigma_minor = sigma)"
        if self.queries.curvature == (0.0, 0.0):
            yield queries.curvature > 0, "curvature", queries.curvature, "for flat cloth (curvature = 0)"


def domain_of(card: Mapping[str, Any]) -> Domain | None:
    """Return the domain on a model card, if there is one."""
    return Domain.model_validate(card["domain"]) if "domain" in card else None


def _numbers(fabric: Fabric) -> dict[str, list[float]]:
    yarns = (fabric.warp, fabric.weft)
    numbers = {name: [float(getattr(yarn, name)) for yarn in yarns] for name in _YARN}
    return numbers | {"optical_thickness": [float(fabric.optical_thickness)]}
