"""Options of `prefiltered`: resolution of the maps, and the rule that widens the roughness."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field

from pipeline.models.options import Gaussian, Name, Options


class PrefilteredOptions(Options):
    """MIP maps of normals and tangents, one point model a query and family; nothing is trained."""

    learns: ClassVar[bool] = False
    seconds: ClassVar[tuple[float, float]] = (0.0, 2e-7)

    model: Literal["prefiltered"] = "prefiltered"
    """Name of its folder in `pipeline.models`."""
    footprint: Gaussian = "gaussian"
    name: Name = "prefiltered"
    """Name in tables."""
    texels_per_yarn: int = Field(default=16, ge=1, le=128)
    """Texels of the finest level along one yarn spacing, at least; a repeat's sides are powers of two."""
    widening: Literal["none", "toksvig", "lean"] = "lean"
    """Source of the widened roughness: none, the mean tangent's length, or the half vector's variance."""
