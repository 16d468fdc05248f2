"""`woven`: one network for many fabrics at many scales [Chen2024Woven]; its options."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field, model_validator

from pipeline.models.options import ComponentLossOptions


class WovenOptions(ComponentLossOptions):
    """One network for many fabrics and scales [Chen2024Woven]."""

    fixed: ClassVar[tuple[str, ...]] = (
        *ComponentLossOptions.fixed, "smallest_size", "largest_size", "transparency_weight"
    )  # fmt: skip
    any_physics: ClassVar[bool] = True
    blends: ClassVar[bool] = True

    model: Literal["woven"] = "woven"
    latent: int = Field(default=64, ge=4, le=512)
    """Length of the material latent."""
    hidden: int = Field(default=128, ge=8, le=1024)
    """Width of the decoder's hidden layers."""
    extra_layer: Literal["fusion", "encoder"] = "fusion"
    """Place of one layer `hidden` -> `hidden`. With `encoder` the decoder has the layers of the paper's figure, 70,148
    parameters. With `fusion` it has 86,660, which we infer from notes on the paper. Both with `one_blob = "plain"`."""
    map_texels: Literal[16, 32, 64, 128] = 32
    """Side of the square normal and tangent maps, which hold one repeat; unknown, one figure of the paper has 512."""
    encoder_channels: int = Field(default=16, ge=4, le=128)
    """Channels after the first convolution of the encoder; they double twice on the way down. Not published."""
    one_blob: Literal["none", "plain", "periodic", "local"] = "local"
    """Encoding of centres: `none` as the bare numbers u, v and size; `plain` as published; `periodic` wraps u and v at
    the repeat's edge; `local` encodes u and v within their yarn and sees a picture of the repeat from the queried place
    (an own change: see the model)."""
    bins: int = Field(default=8, ge=2, le=64)
    """One-blob bins for each of u, v and size; 24 values are published, 3 x 8 is our reading."""
    spatial_fusion: bool = True
    """Merge latent and patch before the directions (the published design); otherwise all enter together."""
    transmission: bool = False
    """Learn cloth with gaps and light from behind: widths, blends and optical thickness join the fabric's parameters
    (the paper reads four and shows one transmissive cloth), and the transparency is a fifth output."""
    standard: bool = True
    """Bring every fabric into standard position first, so that mirror images need not be learnt."""
    roll: bool = True
    """Begin the repeat at a random yarn in every training step: cloth has no origin, and no ground truth is spent."""

    smallest_size: ClassVar[float] = 0.005  # footprint, in repeats, at which the encoded size is 0
    largest_size: ClassVar[float] = 1.0
    """Footprint, in repeats, at which the encoded size is 1; a Gaussian of one repeat already averages all of it."""
    transparency_weight: ClassVar[float] = 1.0  # weight of the transparency's squared error, with `transmission`

    @model_validator(mode="after")
    def _local_is_fused(self) -> WovenOptions:
        if self.one_blob == "local" and not self.spatial_fusion:
            raise ValueError("one_blob = 'local' needs spatial_fusion")
        return self

    @property
    def version(self) -> int:
        """Version of the model's numbers; `transmission` had fewer parameters before."""
        return super().version + self.transmission

    @property
    def departures(self) -> tuple[str, ...]:  # type: ignore[override]
        """Deviations from the published method, for the page."""
        changes = {
            "a picture of the repeat seen from the queried place": self.one_blob == "local",
            "bare numbers in place of one-blobs": self.one_blob == "none",
            "one-blobs that wrap": self.one_blob == "periodic",
            "every cloth in standard position": self.standard,
            "a random origin in every training step": self.roll,
            "no spatial fusion": not self.spatial_fusion,
            "one layer more in the fusion, one less in the encoder": self.extra_layer == "fusion",
            f"width {self.hidden}, latents of {self.latent}": (self.hidden, self.latent) != (128, 64),
            "no light from behind": not self.transmission,
            "widths and optical thickness as parameters, transparency as an output": self.transmission,
            "an encoder of the maps of our own": True,
            f"maps of {self.map_texels} texels": True,
            "Gaussian footprints in place of squares": True,
        }
        return tuple(change for change, made in changes.items() if made)

    @property
    def kinds(self) -> frozenset[str]:  # type: ignore[override]
        """Light from behind, with `transmission`."""
        return frozenset({"behind"} if self.transmission else ())
