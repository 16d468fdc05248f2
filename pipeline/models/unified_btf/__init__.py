"""`unified_btf` [Rainer2020Unified], its predecessor `btf_autoencoder` [Rainer2019Neural], and `universal`; options."""

from typing import ClassVar, Final, Literal, Self

from pydantic import Field, model_validator

from pipeline.models.options import ComponentLossOptions
from pipeline.shards.angular_samples import AngularSamples
from pipeline.shards.generate import ExtraRows
from pipeline.truth.options import TruthOptions

IN_COMPONENTS: Final = "four components in place of RGB, in samples and answers"
ON_ROWS: Final = "trained on rows of all footprints in place of the samples"


class BtfOptions(ComponentLossOptions):
    """Options of encodings of bidirectional textures."""

    fixed: ClassVar[tuple[str, ...]] = (*ComponentLossOptions.fixed, "angles", "directions")
    any_physics: ClassVar[bool] = True
    prepare_seconds: ClassVar[float] = 4.0

    texels_per_yarn: int = Field(default=8, ge=1, le=64)
    """Texels along one yarn spacing."""
    texel_sigma: float = Field(default=0.5, gt=0, le=4)
    """Standard deviation of a texel's footprint, in texels."""
    samples: int = Field(default=128, ge=1, le=65_536)
    """Angular samples of every texel; shards hold those of trained fabrics, any other fabric's are computed when it is
    added."""
    max_angle: float = Field(default=89.0, gt=0, le=89.9)
    """Largest angle of the samples' directions to the macro normal, in degrees."""
    truth: TruthOptions = TruthOptions(estimator="auto", relative_error=0.2, min_count=32, max_count=64)
    """Options of the truth for the samples. Its physics must be that of the data set; its errors may be large, because
    a latent averages over all samples of a texel."""
    hidden: int = Field(default=106, ge=4, le=1024)
    """Width of the decoder's four hidden layers."""

    latent: int
    """Numbers that a texel is known by."""

    channels: ClassVar[int] = 4  # of samples and answers: the components

    angles: ClassVar[str] = "stereographic"
    """The four numbers of a pair of directions: x and y of each over 1 + z; not published."""
    directions: ClassVar[Literal["projected_disc", "hemisphere"]] = "projected_disc"
    """Density of the samples' directions, as in the queries."""

    @property
    def angular_samples(self) -> AngularSamples:
        """The samples of a fabric's texels."""
        return AngularSamples(**{name: getattr(self, name) for name in AngularSamples.model_fields if name != "kind"})

    @property
    def extra_rows(self) -> tuple[ExtraRows, ...]:  # type: ignore[override]
        """The samples of the trained fabrics' texels."""
        return (self.angular_samples,)


class EncoderOptions(BtfOptions):
    """Options of an encoder of angular samples."""

    fixed: ClassVar[tuple[str, ...]] = (*BtfOptions.fixed, "encoder_hidden", "log_samples")

    fewest_samples: int = Field(default=50, ge=1, le=65_536)
    """A training step encodes a fabric from a random number of its samples, from this one to all."""
    weights: int = Field(default=32, ge=1, le=512)
    """Weights m of every sample; not published."""
    encoder_hidden: ClassVar[int] = 64
    """Width of the encoder's two hidden layers; not published."""
    log_samples: ClassVar[bool] = False
    """The encoder reads the specular samples as they are: these average as the cloth does, and trained as well as
    those in log space."""

    @model_validator(mode="after")
    def _enough_samples(self) -> Self:
        if self.fewest_samples > self.samples:
            raise ValueError(f"fewest_samples ({self.fewest_samples}) must not be above samples ({self.samples})")
        return self


class UnifiedBtfOptions(EncoderOptions):
    """One encoder and decoder of angular samples for all fabrics [Rainer2020Unified]."""

    encodes: ClassVar[bool] = True

    seconds: ClassVar[tuple[float, float]] = (4e-5, 1.5e-6)

    model: Literal["unified_btf"] = "unified_btf"
    latent: int = Field(default=32, ge=1, le=512)
    head: Literal["components", "rgb"] = "components"
    """Values of samples and answers: the four components; or linear RGB, as published, trained in random colours. A
    network of RGB encodes measured samples too; it has no use for `diffuse_weight`."""

    @property
    def channels(self) -> int:  # type: ignore[override]
        """Numbers of a sample or an answer."""
        return 3 if self.head == "rgb" else 4

    @property
    def departures(self) -> tuple[str, ...]:  # type: ignore[override]
        """Deviations from the published method, for the page."""
        return "random colours in training, components as colours" if self.head == "rgb" else IN_COMPONENTS, ON_ROWS

    @model_validator(mode="after")
    def _weighs_components(self) -> Self:
        if self.head == "rgb" and self.diffuse_weight != type(self).model_fields["diffuse_weight"].default:
            raise ValueError('diffuse_weight needs head = "components": RGB has no diffuse part of its own')
        return self


class BtfAutoencoderOptions(EncoderOptions):
    """One autoencoder of angular samples for each fabric [Rainer2019Neural]: `unified_btf` with a latent of 8.

    With 3 outputs the decoder has the published 35,725 weights. ADAPTED: the encoder is that of 2020, which reads any
    number of samples, and so are values and loss.
    """

    of_one_material: ClassVar[bool] = True
    departures: ClassVar[tuple[str, ...]] = (IN_COMPONENTS, "the encoder of 2020", ON_ROWS)
    seconds: ClassVar[tuple[float, float]] = (1.5e-5, 1.5e-6)

    model: Literal["btf_autoencoder"] = "btf_autoencoder"
    latent: int = Field(default=8, ge=1, le=512)


class UniversalOptions(BtfOptions):
    """The decoder of `unified_btf` without an encoder: the latents of each fabric are found by descent.

    A fabric that was trained with keeps the latents that were learnt from its rows and angular samples. Those of any
    other are found from its samples, with the decoder as it is.
    """

    fixed: ClassVar[tuple[str, ...]] = (*BtfOptions.fixed, "batch", "latent_rate", "rate")
    seconds: ClassVar[tuple[float, float]] = (1.1e-4, 1.5e-6)
    prepare_seconds: ClassVar[float] = 8.0

    model: Literal["universal"] = "universal"
    latent: int = Field(default=8, ge=1, le=512)
    steps: int = Field(default=200, ge=1, le=100_000)
    """Steps of the descent to the latents of a fabric that was not trained with."""

    batch: ClassVar[int] = 2
    """Samples of every texel a step, of a training and of a descent."""
    latent_rate: ClassVar[float] = 3.0
    """Learning rate of the latents relative to that of the decoder."""
    rate: ClassVar[float] = 0.05
    """Learning rate of the descent at its first step; it falls to 0 along half a cosine."""
