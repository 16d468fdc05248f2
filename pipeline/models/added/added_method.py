"""Options of a method from outside: its code, and its own options."""

from __future__ import annotations

from typing import Any, ClassVar, Final, Literal

from pydantic import Field

from pipeline.models.added.added_code import AddedCode
from pipeline.models.options import Name, Options

ADDED: Final = "added"
"""The value of `model` of all methods from outside."""

GROUP: Final = "twillight.methods"
"""Group of the entry points by which an installed package offers methods."""

Kind = Literal["behind", "stretch", "curvature"]
"""Kind of queries beyond flat cloth, round footprints and light from the front."""


class AddedMethod(AddedCode, Options):
    """A method from outside the package."""

    seconds: ClassVar[tuple[float, float]] = (2e-5, 1e-5)

    model: Literal["added"] = "added"
    """Mark of a method from outside."""
    name: Name
    """Name in tables."""
    own: dict[str, Any] = Field(default={})
    """Its own options: the keywords that it is made with."""
    setting: str = ""
    """Variant that the method states."""
    answers: tuple[Kind, ...] = ()
    """Kinds of queries that it answers beside the plain ones."""
    has_network: bool = False
    """True if it has a network, which the benchmark trains."""
    has_one_fabric: bool = False
    """True if a trained network knows a single fabric."""

    @property
    def learns(self) -> bool:  # type: ignore[override]
        """True if it is trained."""
        return self.has_network

    @property
    def of_one_material(self) -> bool:  # type: ignore[override]
        """True if a trained network knows a single fabric."""
        return self.has_one_fabric

    @property
    def kinds(self) -> frozenset[str]:
        """Kinds of queries that it evaluates."""
        return frozenset(self.answers)

    @property
    def variant(self) -> str:
        """Setting of its only method."""
        return self.setting
