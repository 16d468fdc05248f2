"""Domain of a trained model: the queries, physics and yarns of its training; others are refused.

The domain is on the model card. It limits two uses of a model.

- A file of queries (`twillight evaluate`): kinds and yarns that were not trained on are refused. Within a kind the
  model is evaluated beyond the trained ranges too.
- A scene (`pipeline.models.fallback`): queries beyond the trained ranges are `out_of_domain`. Footprints may exceed the
  range by `_SLACK` of its logarithm, directions may be `_ANGLE` degrees steeper, curvature may not exceed it. A
  footprint of `_AVERAGED` repeats sees the average of the repeat; if training reached that size, larger footprints are
  replaced by the largest one trained on (`within`). A Gaussian of standard deviation s leaves exp(-2 pi^2 s^2) of what
  varies with period 1: at .5 less than a hundredth.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from pydantic import field_validator

from pipeline.compiled.arrays import Float64, Mask
from pipeline.models.method import faults, refuse_other
from pipeline.shards.queries import QueryOptions
from pipeline.truth.options import WALLS_OF_PLANE, TruthOptions
from pipeline.truth.query import Queries
from weaves.errors import BadInput
from weaves.fabric import Fabric
from weaves.validation import Frozen

PHYSICS: Final = ("footprint", "frame", "normaliser", "parallax", "shadows", "walls")
"""Options of the truth that define the learnt quantity; the other options set its accuracy."""

YARN_NUMBERS: Final = ("roughness", "bend", "twist", "relief", "width", "blend")
_SLACK: Final = 0.02  # of a range, that a fabric or a footprint may lie outside
_ANGLE: Final = 1.0  # degrees by which a direction may be steeper than the steepest trained on
_AVERAGED: Final = 0.5  # standard deviation of a footprint that sees the average of the repeat, in repeats


class Domain(Frozen):
    """Queries, physics and yarns that a model was trained on."""

    queries: QueryOptions
    """Distribution of the queries."""
    physics: dict[str, Any]
    """Options of the truth named in `PHYSICS`."""
    yarns: dict[str, tuple[float, float]]
    """Range of each parameter over the yarns of all trained fabrics, and of the optical thickness."""

    @field_validator("physics")
    @classmethod
    def _of_the_plane(cls, physics: dict[str, Any]) -> dict[str, Any]:
        """Complete the card of an earlier version, which knows the fabric plane alone and says nothing of it."""
        return {"parallax": False, "walls": WALLS_OF_PLANE} | physics

    @classmethod
    def of(cls, about: Mapping[str, Any], fabrics: Sequence[Fabric]) -> Domain:
        """Return the domain of a data set, from its manifest's `about` and the fabrics trained on."""
        truth = TruthOptions.model_validate(about.get("truth", {})).model_dump(mode="json")
        return cls(
            queries=QueryOptions.model_validate(about.get("queries", {})),
            physics={name: truth[name] for name in PHYSICS},
            yarns=_ranges([_numbers(fabric) for fabric in fabrics]),
        )

    @property
    def kinds(self) -> frozenset[str]:
        """Kinds of queries trained on, of `behind`, `stretch` and `curvature`."""
        return self.queries.kinds

    @property
    def rims(self) -> bool:
        """True if view rays that meet a wall see a rim."""
        return bool(self.physics["walls"] == "rim")

    def out_of_domain(self, fabric: Fabric, queries: Queries) -> Mask:
        """Return which queries on a fabric lie outside the ranges trained on, (N,); all of them if its yarns do.

        Kinds that were not trained on at all are not checked here, but by `faults`.
        """
        if not self.knows(fabric):
            return np.ones(len(queries.u), np.bool_)
        options = self.queries
        low, high = options.sigma
        slack = (high / low) ** _SLACK + 1e-6
        size = _size(queries)
        result = (size < low / slack) | ((size > high * slack) & ~self._averaged(fabric, queries))
        if options.stretch > 1.0:
            result |= queries.sigma > options.stretch * (1.0 + _SLACK) * queries.sigma_minor
        if options.curvature[1] > 0.0:
            result |= queries.curvature > options.curvature[1]
        if options.max_angle + _ANGLE < 90.0:
            steepest = math.cos(math.radians(options.max_angle + _ANGLE))
            result |= np.minimum(np.abs(queries.wi[:, 2]), np.abs(queries.wo[:, 2])) < steepest
        return np.asarray(result)

    def within(self, fabric: Fabric, queries: Queries) -> Queries:
        """Return queries whose footprints, where they see the average of the repeat, are no larger than trained on."""
        averaged = self._averaged(fabric, queries)
        if not averaged.any():
            return queries
        shrunk = np.where(averaged, self.queries.sigma[1] / _size(queries), 1.0).astype(np.float32)
        return queries._replace(sigma=queries.sigma * shrunk, sigma_minor=queries.sigma_minor * shrunk)

    def _averaged(self, fabric: Fabric, queries: Queries) -> Mask:
        """Return which footprints are larger than those trained on and see the average of the repeat, (N,)."""
        size, high = _size(queries), self.queries.sigma[1]
        return np.asarray((size > high) & (high * queries.sigma_minor / size >= _AVERAGED * max(fabric.weave.repeat)))

    def refuse(self, queries: Queries, model: str) -> None:
        """Refuse queries of a kind that the model never saw: a BadInput that names the first row and column."""
        refuse_other(queries, f"the model {model} was trained for", self.kinds)

    def faults(self, queries: Queries, model: str) -> dict[int, tuple[str, object, str]]:
        """Return the fault of each query of a kind not trained on, in the form of `pipeline.truth.query.faults`."""
        return faults(queries, f"the model {model} was trained for", self.kinds)

    def refuse_fabric(self, fabric: Fabric, model: str) -> None:
        """Refuse a fabric whose yarns lie outside those trained on."""
        for name, values in _numbers(fabric).items():
            low, high = self.yarns[name]
            slack = _SLACK * (high - low) + 1e-6
            for value in values:
                if not low - slack <= value <= high + slack:
                    allowed = f"the model {model} was trained on {low:g} to {high:g} only; --extrapolate uses it anyway"
                    raise BadInput(fabric.name, name, value, allowed)

    def knows(self, fabric: Fabric) -> bool:
        """Return whether the yarns of a fabric lie within the ranges trained on."""
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


def domain_of(cards: Sequence[Mapping[str, Any]]) -> Domain | None:
    """Return the domain on cards of one network, or of several of one fabric and the same queries; None without."""
    domains = [Domain.model_validate(card["domain"]) for card in cards if "domain" in card]
    if not domains:
        return None
    return domains[0].model_copy(update={"yarns": _ranges([domain.yarns for domain in domains])})


def _ranges(parts: Sequence[Mapping[str, Sequence[float]]]) -> dict[str, tuple[float, float]]:
    """Return the range of each parameter over all parts."""
    return {name: (min(min(p[name]) for p in parts), max(max(p[name]) for p in parts)) for name in parts[0]}


def _size(queries: Queries) -> Float64:
    """Return the root of the product of each footprint's axes, the size that `QueryOptions.sigma` limits."""
    return np.asarray(np.sqrt(queries.sigma.astype(np.float64) * queries.sigma_minor))


def _numbers(fabric: Fabric) -> dict[str, list[float]]:
    yarns = (fabric.warp, fabric.weft)
    numbers = {name: [float(getattr(yarn, name)) for yarn in yarns] for name in YARN_NUMBERS}
    return numbers | {"optical_thickness": [float(fabric.optical_thickness)]}
