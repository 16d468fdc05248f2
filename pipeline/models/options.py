"""Every choice the papers leave open, as named options of each model.

Options are data: they enter the fingerprint of a trained model, and a recipe's ``[[models]]`` table is validated by
`ModelOptions`, the union told apart by ``model``. Nothing heavy is imported here, so that plans can be made without
torch.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator


class _Options(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True)


Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$", max_length=64)]
"""A name that can stand in a file name and in a task id."""

Count = Annotated[int, Field(ge=1, le=4096)]
"""A number of random points per query."""


class WovenOptions(_Options):
    """One network for many fabrics and scales [Chen2024Woven]."""

    model: Literal["woven"] = "woven"
    """Which file of `pipeline.models` implements it."""
    name: Name = "woven"
    """Name of the trained model."""
    latent: int = Field(default=64, ge=4, le=512)
    """Length of the material latent."""
    hidden: int = Field(default=128, ge=8, le=1024)
    """Width of the decoder's hidden layers; with latent 64 and 8 bins, 128 gives the published 86,660 parameters."""
    map_texels: Literal[16, 32, 64, 128] = 32
    """Side of the square normal and tangent maps, which hold one repeat; the paper does not say."""
    encoder_channels: int = Field(default=16, ge=4, le=128)
    """Channels after the first convolution of the encoder; they double twice on the way down. Not published."""
    one_blob: Literal["plain", "periodic", "local"] = "local"
    """How centres enter: `plain` as published; `periodic` wraps u and v at the repeat's edge; `local` encodes u and v
    within their yarn and sees a picture of the repeat from the place asked about (an own change: see the model)."""
    bins: int = Field(default=8, ge=2, le=64)
    """One-blob bins for each of u, v and size; the published 24 values are 3 x 8."""
    smallest_size: float = Field(default=0.005, gt=0, le=0.1)
    """Footprint, in repeats, at which the encoded size is 0."""
    largest_size: float = Field(default=1.0, ge=0.25, le=16)
    """Footprint, in repeats, at which the encoded size is 1; a Gaussian of one repeat already averages all of it."""
    spatial_fusion: bool = True
    """Merge latent and patch before the directions (the published design); otherwise all enter together."""
    log_k: float = Field(default=3.0, gt=0, le=1e4)
    """k of the specular space g(x) = ln(k x + 1)."""
    specular_weight: float = Field(default=1.0, ge=0, le=1e4)
    """Weight of the specular squared error, taken in log space."""
    diffuse_weight: float = Field(default=2.0, ge=0, le=1e4)
    """Weight of the diffuse squared error; equal weights starve it."""
    standard: bool = True
    """Bring every fabric into standard position first, so that mirror images need not be learnt."""
    roll: bool = True
    """Begin the repeat at a random yarn in every training step: cloth has no origin, and no ground truth is spent."""

    @model_validator(mode="after")
    def _something_to_learn(self) -> WovenOptions:
        if self.specular_weight == 0 and self.diffuse_weight == 0:
            raise ValueError("specular_weight and diffuse_weight must not both be 0")
        if self.one_blob == "local" and not self.spatial_fusion:
            raise ValueError("one_blob = 'local' needs spatial_fusion")
        return self

    @property
    def departures(self) -> tuple[str, ...]:
        """What is not as published, in words for the page."""
        changes = {
            "a picture of the repeat seen from the place asked about": self.one_blob == "local",
            "one-blobs that wrap": self.one_blob == "periodic",
            "every cloth in standard position": self.standard,
            "a random origin in every training step": self.roll,
            "no spatial fusion": not self.spatial_fusion,
        }
        return tuple(change for change, made in changes.items() if made)


class NeumipOptions(_Options):
    """One offset texture, one feature pyramid and one small decoder for each fabric [Kuznetsov2021NeuMIP]."""

    model: Literal["neumip"] = "neumip"
    """Which file of `pipeline.models` implements it."""
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
    log_k: float = Field(default=3.0, gt=0, le=1e4)
    """k of the specular space g(x) = ln(k x + 1)."""
    specular_weight: float = Field(default=1.0, ge=0, le=1e4)
    """Weight of the specular squared error, taken in log space."""
    diffuse_weight: float = Field(default=2.0, ge=0, le=1e4)
    """Weight of the diffuse squared error."""

    @property
    def departures(self) -> tuple[str, ...]:
        """What is not as published, in words for the page."""
        return ("four components in place of RGB",) + (() if self.offset else ("no offset",))


class PointSampledOptions(_Options):
    """The point model at k random points of the footprint [Jin2022Woven]; nothing is trained."""

    model: Literal["point_sampled"] = "point_sampled"
    """Which file of `pipeline.models` implements it."""
    name: Name = "point_sampled"
    """Name in tables."""
    counts: Annotated[list[Count], Field(min_length=1, max_length=16)] = [1, 2, 3, 4, 8, 16, 64]
    """Numbers k of points a query; each is a row of the tables."""
    footprint: Literal["gaussian", "box"] = "gaussian"
    """Kernel the points are drawn from; must be the kernel of the truth."""


ModelOptions = Annotated[WovenOptions | NeumipOptions | PointSampledOptions, Field(discriminator="model")]
"""Any model's options, told apart by `model`."""

VERSIONS: dict[str, int] = {"woven": 1, "neumip": 1, "point_sampled": 1}
"""Raised by hand when a model's numbers change; part of the fingerprint of what is trained or measured."""
