"""`neumip` [Kuznetsov2021NeuMIP] and its successors, textures of one fabric; their options."""

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from pipeline.models.options import TextureOptions

_Octaves = Annotated[int, Field(ge=0, le=16)]


class NeumipOptions(TextureOptions):
    """One offset texture, one feature pyramid and one small decoder for each fabric [Kuznetsov2021NeuMIP]."""

    any_physics: ClassVar[bool] = True
    seconds: ClassVar[tuple[float, float]] = (1.6e-5, 2e-6)

    model: Literal["neumip"] = "neumip"
    ignore_curvature: bool = False
    """Accept queries on curved cloth, as a flat material: train on rows lit from the front, ignore the curvature, and
    answer 0 where the light is behind the tangent plane."""

    @property
    def departures(self) -> tuple[str, ...]:  # type: ignore[override]
        """Deviations from the published method, for the page."""
        changes = {"no offset": not self.offset, "blind to the curvature it learns from": self.ignore_curvature}
        always = "four components in place of RGB", "rates, loss and sizes of footprints of our own"
        return (*always, *(change for change, made in changes.items() if made))

    @property
    def kinds(self) -> frozenset[str]:  # type: ignore[override]
        """Curved cloth lit from all around, answered as if it were flat, with `ignore_curvature`."""
        return frozenset({"behind", "curvature"} if self.ignore_curvature else ())


class TriplePlaneOptions(NeumipOptions):
    """`neumip` whose decoder reads textures of the half and of the difference vector [Xu2025Comprehensive]."""

    seconds: ClassVar[tuple[float, float]] = (2.5e-5, 4e-6)

    model: Literal["triple_plane"] = "triple_plane"  # type: ignore[assignment]
    direction_texels: int = Field(default=16, ge=2, le=512)
    """Texels along a side of both textures of directions."""

    @property
    def departures(self) -> tuple[str, ...]:  # type: ignore[override]
        """Deviations from the published method, for the page."""
        return (*super().departures, "no silhouettes, no synthesis of larger cloth", "sizes and frame of ours")


class HierarchicalOptions(NeumipOptions):
    """`neumip` with inception blocks and Fourier inputs [Xue2024Hierarchical]."""

    seconds: ClassVar[tuple[float, float]] = (2.2e-5, 3e-6)

    model: Literal["hierarchical"] = "hierarchical"  # type: ignore[assignment]
    octaves: tuple[_Octaves, _Octaves] = (4, 10)
    """Octaves of sines and cosines of directions and of places that the decoder reads; 0 means none."""

    @property
    def departures(self) -> tuple[str, ...]:  # type: ignore[override]
        """Deviations from the published method, for the page."""
        changes = "blocks of one query in place of a picture", "sines of a place over footprints, without the place"
        octaves = () if self.octaves == (4, 10) else (f"Fourier inputs of {self.octaves} octaves",)
        return (*super().departures, *changes, "no loss of gradients", *octaves)
