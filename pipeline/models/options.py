"""Every choice the papers leave open, as named options of each model.

Options are data: they enter the fingerprint of a trained model, and a recipe's ``[[models]]`` table is validated by
`ModelOptions`, the union told apart by ``model``. Nothing heavy is imported here, so that plans can be made without
torch.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, Self, get_args

from pydantic import BaseModel, ConfigDict, Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from pipeline.truth.options import TruthOptions


class _Options(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True)

    version: ClassVar[int] = 1
    """Raised by hand when a model's numbers change; part of the fingerprint of what is trained or measured."""
    learns: ClassVar[bool] = True
    """Whether there is anything to train."""
    of_one_material: ClassVar[bool] = False
    """Whether a trained model knows a single fabric."""
    blends: ClassVar[bool] = False
    """Whether it answers for what lies between two fabrics, from blended latents."""
    any_physics: ClassVar[bool] = False
    """Whether it learns whatever frame, normaliser, geometry, shadows and variation the truth has; else it knows the
    default ones."""
    seconds: ClassVar[tuple[float, float]] = (2e-5, 3e-6)
    """Estimate of the time of one query in training and in prediction, on one core of a server of 2022."""

    @property
    def departures(self) -> tuple[str, ...]:
        """What is not as published, in words for the page."""
        return ()

    @property
    def kinds(self) -> frozenset[str]:
        """Which of `behind`, `stretch` and `curvature` (`QueryOptions`) its queries may have."""
        return frozenset()

    @property
    def knobs(self) -> tuple[int, ...]:
        """Values k of the speed-accuracy knob, each a method of its own with the setting ``k = ...``; none: one method.

        The seconds of a prediction are then those of k = 1.
        """
        return ()


Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$", max_length=64)]
"""A name that can stand in a file name and in a task id."""

Count = Annotated[int, Field(ge=1, le=4096)]
"""A number of random points per query."""


class WovenOptions(_Options):
    """One network for many fabrics and scales [Chen2024Woven]."""

    any_physics: ClassVar[bool] = True
    blends: ClassVar[bool] = True

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
    one_blob: Literal["none", "plain", "periodic", "local"] = "local"
    """How centres enter: `none` as the bare numbers u, v and size; `plain` as published; `periodic` wraps u and v at
    the repeat's edge; `local` encodes u and v within their yarn and sees a picture of the repeat from the place asked
    about (an own change: see the model)."""
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
    transparency_weight: float = Field(default=1.0, ge=0, le=1e4)
    """Weight of the transparency's squared error, with `transmission`."""
    transmission: bool = False
    """Learn cloth with gaps and light from behind: widths and optical thickness join the fabric's parameters (the paper
    reads four and shows one transmissive cloth), and the transparency is a fifth output."""
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
            "bare numbers in place of one-blobs": self.one_blob == "none",
            "one-blobs that wrap": self.one_blob == "periodic",
            "every cloth in standard position": self.standard,
            "a random origin in every training step": self.roll,
            "no spatial fusion": not self.spatial_fusion,
        }
        return tuple(change for change, made in changes.items() if made)

    @property
    def kinds(self) -> frozenset[str]:
        """Light from behind, with `transmission`."""
        return frozenset({"behind"} if self.transmission else ())


class NeumipOptions(_Options):
    """One offset texture, one feature pyramid and one small decoder for each fabric [Kuznetsov2021NeuMIP]."""

    of_one_material: ClassVar[bool] = True
    any_physics: ClassVar[bool] = True
    seconds: ClassVar[tuple[float, float]] = (1.2e-5, 1.5e-6)

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
    ignore_curvature: bool = False
    """Take part in comparisons on curved cloth as a flat material does: learn from what is lit from the front, blind to
    the curvature, and answer 0 where the light is behind the tangent plane."""

    @model_serializer(mode="wrap")
    def _older_names(self, write: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leave what came later out while it changes nothing: trained models keep their fingerprints."""
        values: dict[str, Any] = write(self)
        if not self.ignore_curvature:
            values.pop("ignore_curvature", None)
        return values

    @property
    def departures(self) -> tuple[str, ...]:
        """What is not as published, in words for the page."""
        changes = {"no offset": not self.offset, "blind to the curvature it learns from": self.ignore_curvature}
        return ("four components in place of RGB", *(change for change, made in changes.items() if made))

    @property
    def kinds(self) -> frozenset[str]:
        """Curved cloth lit from all around, answered as if it were flat, with `ignore_curvature`."""
        return frozenset({"behind", "curvature"} if self.ignore_curvature else ())


class CurvedOptions(_Options):
    """Opacity, offset and reflectance of one fabric on curved surfaces [Kuznetsov2022Curved]."""

    of_one_material: ClassVar[bool] = True
    seconds: ClassVar[tuple[float, float]] = (2.5e-5, 2e-6)

    model: Literal["curved"] = "curved"
    """Which file of `pipeline.models` implements it."""
    name: Name = "curved"
    """Name of the trained model."""
    texels_per_yarn: int = Field(default=16, ge=1, le=256)
    """Texels of the finest level along one yarn spacing; textures hold one repeat and wrap."""
    levels: int = Field(default=0, ge=0, le=12)
    """Levels of the pyramids of opacity and reflectance: 1 as published, for questions without a footprint; 0 means
    down to one texel."""
    channels: int = Field(default=7, ge=1, le=32)
    """Channels of every texture; the paper does not say."""
    hidden: int = Field(default=24, ge=4, le=256)
    """Width of the three hidden layers of all perceptrons."""
    offset: bool = True
    """Shift the centre along the view by a learnt depth before the look-up."""
    silhouette: Literal["opacity", "grazing"] = "opacity"
    """What makes the silhouette: the opacity, or the cosine at which a ray just touches, in which opacity is a step."""
    directions: Literal["vector", "projected"] = "vector"
    """How directions enter: as unit vectors, or as their x and y, which cannot tell light in front from light behind;
    the paper does not say."""
    curvature_input: Literal["linear", "root", "touch"] = "touch"
    """How the curvature enters: `linear` as it is, `root` its square root, or `touch`, beside the root, the share
    tan / sqrt(tan^2 + 2 kappa) of the viewer's tangent, which says how deep the ray dips."""
    certain: bool = True
    """Answer an opacity of 1 where every ray sinks below every yarn; only for cloths without gaps."""
    footprint: Literal["gaussian", "box"] = "gaussian"
    """Kernel of the questions about the silhouette; must be the kernel of the truth."""
    silhouette_texels_per_yarn: int = Field(default=4, ge=1, le=256)
    """Texels of the opacity's own texture. A ray meets crests yarns away, so that finer ones hold little but noise."""
    silhouette_rows: int = Field(default=262_144, ge=64, le=2**24)
    """Questions about the silhouette, asked once before the training."""
    silhouette_points: Literal[32, 64, 128, 256, 512, 1024] = 32
    """Rays of each; of grazing cosines a sixteenth."""
    silhouette_sigma: tuple[float, float] = (0.05, 32.0)
    """Range of their footprints, in yarn spacings; drawn log-uniformly."""
    largest_curvature: float = Field(default=0.5, gt=0, le=1)
    """Largest curvature learnt and answered, in 1/yarn spacings."""
    silhouette_anywhere: float = Field(default=0.1, ge=0, le=1)
    """Share of these questions with any cosine; the others lie where the opacity varies."""
    silhouette_seed: int = Field(default=0, ge=0, lt=2**63)
    """Seed of these questions and of their rays."""
    silhouette_weight: float = Field(default=0.1, ge=0, le=1e4)
    """Weight of the silhouette's loss. It shares no weight with the rest, so it sets little but what clipping keeps."""
    blur: float = Field(default=8.0, ge=0, le=64)
    """Standard deviation, in finest texels, of the Gaussian blur on the textures at the first step; 0 means none."""
    blur_halving: float = Field(default=0.11, gt=0, le=1)
    """Share of the training after which the blur has halved; the paper does not say, so it is that of `neumip`."""
    offset_frozen: float = Field(default=0.33, ge=0, le=1)
    """Share of the training after which the offset texture is held fixed, as in `neumip`."""
    texture_rate: float = Field(default=3.0, gt=0, le=1000)
    """Learning rate of the textures relative to that of the perceptrons: short trainings touch each texel rarely."""
    log_k: float = Field(default=3.0, gt=0, le=1e4)
    """k of the specular space g(x) = ln(k x + 1)."""
    specular_weight: float = Field(default=1.0, ge=0, le=1e4)
    """Weight of the specular squared error, taken in log space."""
    diffuse_weight: float = Field(default=2.0, ge=0, le=1e4)
    """Weight of the diffuse squared error."""

    @model_validator(mode="after")
    def _range(self) -> CurvedOptions:
        low, high = self.silhouette_sigma
        if not 0 < low <= high:
            raise ValueError(f"silhouette_sigma must be [low, high] with 0 < low <= high, got [{low}, {high}]")
        return self

    @property
    def departures(self) -> tuple[str, ...]:
        """What is not as published, in words for the page."""
        changes = {
            "pyramids for footprints": self.levels != 1,
            "no offset": not self.offset,
            "the root of the curvature as an input": self.curvature_input == "root",
            "how deep the ray dips as an input": self.curvature_input == "touch",
            "full opacity where it is certain": self.certain,
        }
        return ("four components in place of RGB", *(change for change, made in changes.items() if made))

    @property
    def kinds(self) -> frozenset[str]:
        """Curved cloth lit from all around."""
        return frozenset({"behind", "curvature"})


class PointSampledOptions(_Options):
    """The point model at k random points of the footprint [Jin2022Woven]; nothing is trained."""

    learns: ClassVar[bool] = False
    seconds: ClassVar[tuple[float, float]] = (0.0, 4e-7)

    model: Literal["point_sampled"] = "point_sampled"
    """Which file of `pipeline.models` implements it."""
    name: Name = "point_sampled"
    """Name in tables."""
    counts: Annotated[list[Count], Field(min_length=1, max_length=16)] = [1, 2, 3, 4, 8, 16, 64]
    """Numbers k of points a query; each is a row of the tables."""
    footprint: Literal["gaussian", "box"] = "gaussian"
    """Kernel the points are drawn from; must be the kernel of the truth."""
    sequence: Literal["random", "r2"] = "random"
    """Independent points, or the R2 sequence with one random shift a query."""
    visibility: Literal["exact", "horizon"] = "exact"
    """A march through the cloth in double precision, or a look-up of tabulated horizons in single precision."""
    horizon_nodes: int = Field(default=32, ge=4, le=128)
    """Nodes of the horizon map on each piece of yarn in a cell, across and along; the nearest is taken."""
    azimuths: int = Field(default=64, ge=8, le=512)
    """Directions of the horizon map; linear between them."""

    @model_validator(mode="after")
    def _horizons_of_gaussians(self) -> PointSampledOptions:
        if self.visibility == "horizon" and self.footprint != "gaussian":
            raise ValueError("visibility = 'horizon' needs footprint = 'gaussian'")
        return self

    @property
    def knobs(self) -> tuple[int, ...]:
        """The numbers of points."""
        return tuple(self.counts)

    @property
    def kinds(self) -> frozenset[str]:
        """All, with exact visibility."""
        return frozenset({"behind", "stretch", "curvature"} if self.visibility == "exact" else ())


class BtfOptions(_Options):
    """What both encodings of bidirectional textures leave open."""

    texels_per_yarn: int = Field(default=8, ge=1, le=64)
    """Texels along one yarn spacing."""
    texel_sigma: float = Field(default=0.5, gt=0, le=4)
    """Standard deviation of a texel's footprint, in texels."""
    samples: int = Field(default=128, ge=1, le=65_536)
    """Angular samples of every texel: drawn from the truth when a fabric is added."""
    fewest_samples: int = Field(default=50, ge=1)
    """A training step encodes a fabric from a random number of its samples, from this one to all."""
    directions: Literal["projected_disc", "hemisphere"] = "projected_disc"
    """Density of the samples' directions, as in the queries."""
    max_angle: float = Field(default=89.0, gt=0, le=89.9)
    """Largest angle of the samples' directions to the macro normal, in degrees."""
    truth: TruthOptions = TruthOptions(estimator="auto", relative_error=0.2, min_count=32, max_count=64)
    """How samples are answered. Its physics must be that of the data set; its errors may be large, because a latent
    averages over all samples of a texel."""
    angles: Literal["stereographic", "disc"] = "stereographic"
    """The four numbers of a pair of directions: x and y of each (`disc`), or those over 1 + z; not published."""
    log_samples: bool = False
    """Whether the encoder reads the specular samples in log space, as the decoder answers; linear ones average as the
    cloth does, and taught as much."""
    weights: int = Field(default=32, ge=1, le=512)
    """Weights m of every sample; not published."""
    encoder_hidden: int = Field(default=64, ge=4, le=1024)
    """Width of the encoder's two hidden layers; not published."""
    hidden: int = Field(default=106, ge=4, le=1024)
    """Width of the decoder's four hidden layers."""
    log_k: float = Field(default=3.0, gt=0, le=1e4)
    """k of the specular space g(x) = ln(k x + 1)."""
    specular_weight: float = Field(default=1.0, ge=0, le=1e4)
    """Weight of the specular squared error, taken in log space; the published loss is unknown."""
    diffuse_weight: float = Field(default=2.0, ge=0, le=1e4)
    """Weight of the diffuse squared error."""

    latent: int
    """Numbers that a texel is known by."""
    model: str
    """Which file of `pipeline.models` implements it."""
    name: Name
    """Name of the trained model."""

    @model_validator(mode="after")
    def _enough_samples(self) -> Self:
        if self.fewest_samples > self.samples:
            raise ValueError(f"fewest_samples ({self.fewest_samples}) must not be above samples ({self.samples})")
        if self.specular_weight == 0 and self.diffuse_weight == 0:
            raise ValueError("specular_weight and diffuse_weight must not both be 0")
        return self


class UnifiedBtfOptions(BtfOptions):
    """One encoder and decoder of angular samples for all fabrics [Rainer2020Unified]."""

    seconds: ClassVar[tuple[float, float]] = (4e-5, 1.5e-6)

    model: Literal["unified_btf"] = "unified_btf"
    name: Name = "unified_btf"
    latent: int = Field(default=32, ge=1, le=512)

    @property
    def departures(self) -> tuple[str, ...]:
        """What is not as published, in words for the page."""
        return ("four components in place of RGB, in samples and answers",)


class BtfAutoencoderOptions(BtfOptions):
    """One autoencoder of angular samples for each fabric [Rainer2019Neural]."""

    of_one_material: ClassVar[bool] = True
    seconds: ClassVar[tuple[float, float]] = (1.5e-5, 1.5e-6)

    model: Literal["btf_autoencoder"] = "btf_autoencoder"
    name: Name = "btf_autoencoder"
    latent: int = Field(default=8, ge=1, le=512)

    @property
    def departures(self) -> tuple[str, ...]:
        """What is not as published, in words for the page."""
        return ("four components in place of RGB, in samples and answers", "the encoder of 2020")


class TableOptions(_Options):
    """The ground truth's own table as a method: sums over k nodes a yarn spacing; nothing is trained."""

    learns: ClassVar[bool] = False
    seconds: ClassVar[tuple[float, float]] = (0.0, 1.2e-6)

    model: Literal["table"] = "table"
    """Which file of `pipeline.models` implements it."""
    footprint: Literal["gaussian"] = "gaussian"
    """Kernel it knows; must be the kernel of the truth."""
    name: Name = "table"
    """Name in tables."""
    nodes: Annotated[list[Annotated[int, Field(ge=4, le=64)]], Field(min_length=1, max_length=16)] = [8, 12, 16, 24, 32]
    """Numbers k of nodes a yarn spacing; each is a row of the tables."""
    azimuths: int = Field(default=128, ge=8, le=512)
    """Directions in which horizons are known."""

    @property
    def knobs(self) -> tuple[int, ...]:
        """The numbers of nodes."""
        return tuple(self.nodes)


class QuadratureOptions(_Options):
    """Gauss-Legendre rules on every piece of yarn, k nodes across it; nothing is trained."""

    learns: ClassVar[bool] = False
    seconds: ClassVar[tuple[float, float]] = (0.0, 3e-7)

    model: Literal["quadrature"] = "quadrature"
    """Which file of `pipeline.models` implements it."""
    footprint: Literal["gaussian"] = "gaussian"
    """Kernel it knows; must be the kernel of the truth."""
    name: Name = "quadrature"
    """Name in tables."""
    nodes: Annotated[list[Annotated[int, Field(ge=2, le=16)]], Field(min_length=1, max_length=15)] = [
        2,
        4,
        6,
        8,
        12,
        16,
    ]
    """Numbers k of nodes across a yarn; each is a row of the tables."""
    along: float = Field(default=0.5, ge=0.125, le=1)
    """Nodes along a cell as a share of those across; at least 2. Equal numbers cost twice the time and gain nothing."""
    shadows: Literal["soft", "hard", "none"] = "soft"
    """Whether horizons hide nodes: by a ramp as wide as the horizon spreads over the node, by a step, or not at all."""
    horizon_nodes: int = Field(default=16, ge=4, le=128)
    """Nodes of the horizon map on each piece of yarn in a cell, across and along."""
    azimuths: int = Field(default=32, ge=8, le=512)
    """Directions of the horizon map; linear between them."""

    @property
    def knobs(self) -> tuple[int, ...]:
        """The numbers of nodes."""
        return tuple(self.nodes)


class PrefilteredOptions(_Options):
    """MIP maps of normals and tangents, one point model a query and family; nothing is trained."""

    learns: ClassVar[bool] = False
    seconds: ClassVar[tuple[float, float]] = (0.0, 2e-7)

    model: Literal["prefiltered"] = "prefiltered"
    """Which file of `pipeline.models` implements it."""
    footprint: Literal["gaussian"] = "gaussian"
    """Kernel it knows; must be the kernel of the truth."""
    name: Name = "prefiltered"
    """Name in tables."""
    texels_per_yarn: int = Field(default=16, ge=1, le=128)
    """Texels of the finest level along one yarn spacing, at least; a repeat's sides are powers of two."""
    widening: Literal["none", "toksvig", "lean"] = "lean"
    """What widens the roughness: nothing, the mean tangent's length, or the half vector's variance."""


class SelvageOptions(_Options):
    """Sums over few nodes, corrected by a small network: one for many fabrics and scales; own design."""

    seconds: ClassVar[tuple[float, float]] = (4e-6, 1.5e-6)

    model: Literal["selvage"] = "selvage"
    """Which file of `pipeline.models` implements it."""
    name: Name = "selvage"
    """Name of the trained model."""
    width: Literal[16, 32, 64] = 64
    """Width of the hidden layers."""
    layers: int = Field(default=2, ge=1, le=8)
    """Hidden layers."""
    exchange: bool = True
    """Exchange warp and weft in a random half of the training steps."""
    measured_rows: int = Field(default=1024, ge=16, le=2**20)
    """Queries of each training fabric over which features are normalised to mean 0 and deviation 1."""
    specular_colour: float = Field(default=0.3, gt=0, le=1e4)
    """Colour of the specular components in the loss."""
    diffuse_colour: float = Field(default=0.5, gt=0, le=1e4)
    """Colour of the diffuse components in the loss."""
    colour_weight: float = Field(default=1.0, ge=0, le=1e4)
    """Weight of the squared error of the whole colour beside those of the components."""
    bound: bool = True
    """Never answer more than the sums do without shadows: the diffuse components then return at most what arrives. What
    the rule of `narrow_nodes` answers is not bounded."""
    narrow_nodes: int = Field(default=0, ge=0, le=16)
    """Nodes across a yarn of the Gauss rule (`quadrature`) that answers small footprints in place of the network; 0:
    the network answers all."""
    seam: tuple[float, float] = (0.18, 0.28)
    """Standard deviations, in yarn spacings, below which the rule answers alone and above which the network does; in
    between they are blended."""
    dark: float = Field(default=0.1, gt=0, le=1e4)
    """Colour well above which squared errors are divided by the colour, and well below which they are not."""
    footprint: Literal["gaussian"] = "gaussian"
    """Kernel of the sums; must be the kernel of the truth."""

    @model_validator(mode="after")
    def _seam_has_a_width(self) -> SelvageOptions:
        if self.narrow_nodes == 1:
            raise ValueError("narrow_nodes must be 0 or from 2 to 16")
        if not 0 < self.seam[0] < self.seam[1]:
            raise ValueError(f"seam must be [low, high] with 0 < low < high, got {list(self.seam)}")
        return self


class SumsOptions(_Options):
    """The sums of `selvage` without its network; nothing is trained."""

    learns: ClassVar[bool] = False
    seconds: ClassVar[tuple[float, float]] = (0.0, 1.2e-6)

    model: Literal["sums"] = "sums"
    """Which file of `pipeline.models` implements it."""
    name: Name = "sums"
    """Name in tables."""
    footprint: Literal["gaussian"] = "gaussian"
    """Kernel of the sums; must be the kernel of the truth."""


ModelOptions = Annotated[
    WovenOptions
    | NeumipOptions
    | CurvedOptions
    | PointSampledOptions
    | UnifiedBtfOptions
    | BtfAutoencoderOptions
    | TableOptions
    | QuadratureOptions
    | PrefilteredOptions
    | SelvageOptions
    | SumsOptions,
    Field(discriminator="model"),
]
"""Any model's options, told apart by `model`."""

CLASSES: dict[str, type[_Options]] = {
    kind.model_fields["model"].default: kind for kind in get_args(get_args(ModelOptions)[0])
}
"""The options' class of every model, by the name of its file."""
