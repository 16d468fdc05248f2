"""Options of `neumip`: textures and perceptrons of one fabric, and how they are trained."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer

from pipeline.models.options import LogK, Name, Options, Weight


class NeumipOptions(Options):
    """One offset texture, one feature pyramid and one small decoder for each fabric [Kuznetsov2021NeuMIP]."""

    of_one_material: ClassVar[bool] = True
    any_physics: ClassVar[bool] = True
    seconds: ClassVar[tuple[float, float]] = (1.2e-5, 1.5e-6)

    model: Literal["neumip"] = "neumip"
    """Name of its folder in `pipeline.models`."""
    name: Name = "neumip"
    """Name of the trained model."""
    texels_per_yarn: int = Field(default=16, ge=1, le=256)
    """Texels of the finest level along one yarn spacing; textures hold one repeat and wrap."""
    levels: int = Field(default=0, ge=0, le=12)
    """Levels of the pyramid, each half as fine as the one before; 0 means down to one texel."""
    channels: int = Field(default=7, ge=1, le=32)
    """Channels of every texture."""
    hidden: int = Field(default=25, ge=4, le=256)
    """Width of the three hidden layers of both perceptrons."""
    offset: bool = True
    """Shift the centre along the view by a learnt depth before the look-up."""
    blur: float = Field(default=8.0, ge=0, le=64)
    """Standard deviation, in finest texels, of the Gaussian blur on the textures at the first step; 0 means none."""
    blur_halving: float = Field(default=0.11, gt=0, le=1)
    """Share of the training after which the blur has halved (published: 3,333 of 30,000 iterations)."""
    offset_frozen: float = Field(default=0.33, ge=0, le=1)
    """Share of the training after which the offset texture is held fixed (published: 10,000 of 30,000 iterations)."""
    texture_rate: float = Field(default=3.0, gt=0, le=1000)
    """Learning rate of the textures relative to that of the perceptrons: short trainings touch each texel rarely."""
    log_k: LogK = 3.0
    specular_weight: Weight = 1.0
    """Weight of the specular squared error, taken in log space."""
    diffuse_weight: Weight = 2.0
    """Weight of the diffuse squared error."""
    ignore_curvature: bool = False
    """Accept queries on curved cloth, as a flat material: train on rows lit from the front, ignore the curvature, and
    answer 0 where the light is behind the tangent plane."""

    @model_serializer(mode="wrap")
    def _older_names(self, write: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Omit newer options that have their defaults, so that trained models keep their fingerprints."""
        values: dict[str, Any] = write(self)
        if not self.ignore_curvature:
            values.pop("ignore_curvature", None)
        return values

    @property
    def departures(self) -> tuple[str, ...]:
        """Deviations from the published method, for the page."""
        changes = {"no offset": not self.offset, "blind to the curvature it learns from": self.ignore_curvature}
        return ("four components in place of RGB", *(change for change, made in changes.items() if made))

    @property
    def kinds(self) -> frozenset[str]:
        """Curved cloth lit from all around, answered as if it were flat, with `ignore_curvature`."""
        return frozenset({"behind", "curvature"} if self.ignore_curvature else ())
