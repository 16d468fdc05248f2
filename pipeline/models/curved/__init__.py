"""`curved`: reflectance, offset and silhouette of one fabric on curved surfaces [Kuznetsov2022Curved]; its options."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field, model_validator

from pipeline.models.options import TextureOptions
from pipeline.shards.generate import ExtraRows
from pipeline.shards.silhouettes import SilhouetteRows


class CurvedOptions(TextureOptions):
    """Opacity, offset and reflectance of one fabric on curved surfaces [Kuznetsov2022Curved]."""

    fixed: ClassVar[tuple[str, ...]] = (
        *TextureOptions.fixed, "certain", "silhouette_anywhere", "silhouette_points", "silhouette_seed",
        "silhouette_texels_per_yarn", "silhouette_weight",
    )  # fmt: skip
    any_physics: ClassVar[bool] = True
    seconds: ClassVar[tuple[float, float]] = (2.5e-5, 2e-6)
    kinds: ClassVar[frozenset[str]] = frozenset({"behind", "curvature"})

    model: Literal["curved"] = "curved"
    hidden: int = Field(default=24, ge=4, le=256)
    silhouette: Literal["opacity", "grazing"] = "opacity"
    """Quantity of the silhouette: the opacity, or the grazing cosine, in which opacity is a step."""
    directions: Literal["vector", "projected"] = "vector"
    """Encoding of directions: as unit vectors, or as their x and y, which are the same for light in front and behind;
    the paper does not say."""
    curvature_input: Literal["linear", "root", "touch"] = "touch"
    """Encoding of the curvature: `linear` as it is, `root` its square root, or `touch`, beside the root, the share
    tan / sqrt(tan^2 + 2 kappa) of the viewer's tangent, which says how deep the ray dips."""
    certain: ClassVar[bool] = True
    """Answer an opacity of 1 where every ray sinks below every yarn; only for cloths without gaps."""
    footprint: Literal["gaussian", "box"] = "gaussian"
    """Kernel of the queries about the silhouette; must be the kernel of the truth."""
    silhouette_texels_per_yarn: ClassVar[int] = 4
    """Texels of the opacity's own texture. A ray meets crests yarns away, so that finer ones hold little but noise."""
    silhouette_rows: int = Field(default=262_144, ge=64, le=2**24)
    """Queries about the silhouette, in shards of their own."""
    silhouette_points: ClassVar[int] = 32
    """Rays of each query; a grazing cosine takes a sixteenth of them."""
    silhouette_sigma: tuple[float, float] = (0.05, 32.0)
    """Range of their footprints, in yarn spacings; drawn log-uniformly."""
    largest_curvature: float = Field(default=0.5, gt=0, le=1)
    """Largest curvature learnt and answered, in 1/yarn spacings."""
    silhouette_seed: ClassVar[int] = 0
    """Seed of these queries and of their rays."""
    silhouette_anywhere: ClassVar[float] = 0.1
    """Share of the queries about the silhouette with any cosine; the others lie where the opacity varies."""
    silhouette_weight: ClassVar[float] = 0.1
    """Weight of the silhouette's loss. Its network shares no parameter with the rest, so it matters for gradient
    clipping only."""

    @model_validator(mode="after")
    def _range(self) -> CurvedOptions:
        low, high = self.silhouette_sigma
        if not 0 < low <= high:
            raise ValueError(f"silhouette_sigma must be [low, high] with 0 < low <= high, got [{low}, {high}]")
        return self

    @property
    def extra_rows(self) -> tuple[ExtraRows, ...]:  # type: ignore[override]
        """The queries about the silhouette of the trained fabric."""
        names = "rows", "points", "sigma", "anywhere", "seed"
        rows = SilhouetteRows(
            kind="opacity" if self.silhouette == "opacity" else "grazing_cosine",
            largest_curvature=self.largest_curvature,
            footprint=self.footprint,
            **{name: getattr(self, f"silhouette_{name}") for name in names},
        )
        return (rows,)

    @property
    def departures(self) -> tuple[str, ...]:  # type: ignore[override]
        """Deviations from the published method, for the page."""
        changes = {
            "pyramids for footprints": self.levels != 1,
            "no offset": not self.offset,
            "the root of the curvature as an input": self.curvature_input == "root",
            "how deep the ray dips as an input": self.curvature_input == "touch",
            "full opacity where it is certain, from a coarser texture": True,
            "mean and deviation of a grazing cosine in place of opacity": self.silhouette == "grazing",
        }
        return (
            "four components in place of RGB",
            "rates, loss and sizes of our own",
            *(change for change, made in changes.items() if made),
        )
