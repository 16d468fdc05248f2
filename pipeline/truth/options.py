"""Every choice of the ground truth that the papers leave open, as named options recorded in the shards."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator


class TruthOptions(BaseModel):
    """How one patch BSDF value is computed."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True)

    estimator: Literal["mc", "owen"] = "owen"
    """`mc`: independent random points; `owen`: Owen-scrambled Sobol points in independent replicates."""
    footprint: Literal["gaussian", "box"] = "gaussian"
    """Kernel k_P; the box is the square with the same standard deviation: side = sigma sqrt(12)."""
    relative_error: float = Field(default=0.02, gt=0, le=1)
    """Stop when the norm of the four standard errors falls below this share of the norm of the four means."""
    min_count: int = Field(default=256, ge=32)
    """Points before the first look at the error; a power of two."""
    max_count: int = Field(default=4096, ge=32)
    """Points after which a query is given up on with the error it has; a power of two. Patches that are all but hidden
    may take 16 times as many."""
    frame: Literal["ply"] = "ply"
    """Cosines inside the yarn layer are taken to the ply normal."""
    normaliser: Literal["visible"] = "visible"
    """The denominator is the projected area that the viewer sees, A_P."""
    geometry: Literal["torus"] = "torus"
    """Yarns are bent, twisted cylinders that form a true height field."""

    @model_validator(mode="after")
    def _powers_of_two(self) -> TruthOptions:
        for name in ("min_count", "max_count"):
            count = getattr(self, name)
            if count & (count - 1):
                raise ValueError(f"{name} must be a power of two, got {count}")
        if self.max_count < self.min_count:
            raise ValueError(f"max_count ({self.max_count}) must not be below min_count ({self.min_count})")
        return self
