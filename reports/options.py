"""Options of the benchmark: what it measures and how finely.

Each measurement takes the class of the options that it reads, and no more: what enters the identity of its task is what
shapes its numbers. `BenchOptions` joins them as the keys of a recipe. Nothing heavy is imported here.
"""

from typing import Annotated, Final, Literal, TypeVar

from pydantic import Field

from pipeline.models.options import RoundFootprint
from pipeline.scenes.options import SceneOptions, View, ViewOptions
from pipeline.truth.options import TruthOptions
from weaves.validation import Frozen

LATENT_PAIRS: Final[tuple[tuple[str, str, Literal["yarns", "draft"]], ...]] = (
    ("denim", "satin_8", "yarns"),
    ("silk_charmeuse", "wool_gabardine", "yarns"),
    ("polyester_lining", "basket", "yarns"),
    ("basket", "denim", "draft"),
)
"""Presets between whose latents errors are measured: each first one, with the yarns or the draft of the other."""

Role = Literal["seen", "unseen"]  # role of a measured fabric: `seen` if general models saw it in training

Side = Annotated[int, Field(ge=16, le=4096)]  # side of a picture in pixels

RuntimeName = Literal["eager-bf16", "eager-fp16", "compile", "compile-bf16", "onnx", "onnx-int8"]
"""Ways to run a trained method, `pipeline.models.runtimes` says which."""

EXTREME_PRECISIONS: Final[tuple[RuntimeName, ...]] = ("eager-bf16", "eager-fp16")
"""Precisions that every trained method is measured in at its extremes, beside single precision."""

EXTREME_TRUTH: Final = TruthOptions(estimator="owen", relative_error=0.01, min_count=4096, max_count=1 << 16)
"""Truth of the extremes: about a second a fabric; .1 to .5 % from a million points a query at every footprint, and .1
to 3 % with light at 89.9 degrees, where fewer points miss the few that shine."""

_Kind = TypeVar("_Kind", bound=Frozen)


class EdgeOptions(Frozen):
    """The edge of a cloth cylinder (`reports.measure.silhouette`): cylinder, camera, light and truth."""

    radius: float = Field(default=10.0, ge=1, le=1e4)
    """Of the boundary, in yarn spacings."""
    depth: float = Field(default=0.24, gt=0)
    """Width of the strip, in yarn spacings; less than the radius. Rays rise again from depths of a few tenths of a
    yarn spacing at most."""
    pixel: float = Field(default=0.04, gt=0, le=1)
    """Side of a pixel, in yarn spacings; its Gaussian has half of it as standard deviation."""
    rows: int = Field(default=200, ge=1, le=4096)
    """Pixels along the edge."""
    light: tuple[float, float] = (60.0, 20.0)
    """In degrees: angle from the camera's direction towards the edge's side, and elevation along the axis."""
    truth: TruthOptions = TruthOptions(relative_error=0.05, max_count=1024)
    """How true the truth is. Its light takes seconds a fabric at 5 %, a minute at 2 %."""
    seed: int = Field(default=0, ge=0, lt=2**63)
    """Of the truth's points."""


class ImageOptions(Frozen):
    """How a picture is compared with the truth's (`reports.measure.scene.image_error`)."""

    block: int = Field(default=16, ge=1, le=4096)
    """Side of the blocks of pixels that intervals draw anew; at most a quarter of the picture's shorter side. It
    should exceed the distance over which errors resemble each other."""
    resamples: int = Field(default=500, ge=100, le=100_000)
    """Bootstrap resamples."""
    seed: int = Field(default=0, ge=0, lt=2**63)
    """Of the resamples and of the noised copy of the truth."""


class _Seeded(Frozen):
    seed: int = Field(default=0, ge=0, lt=2**63)
    """Seed of the truth's points and of the points of random methods."""


class ShotOptions(_Seeded):
    """The frames of a scene, and how true their truth is (`reports.measure.scene.shot`)."""

    size: tuple[Side, Side] = (96, 72)
    """Width and height of a frame, in pixels."""
    frames: int = Field(default=6, ge=1, le=1024)
    """Frames of the camera's way, from the first on, for aliasing; pictures are compared at the first."""
    options: SceneOptions = SceneOptions(environment_directions=8)
    """How scenes become queries."""
    truth: TruthOptions = TruthOptions(estimator="auto", relative_error=0.03, min_count=256, max_count=1024)
    """How true the first frame is. Below 256 points a query may miss one family of yarns altogether."""
    frame_truth: TruthOptions = TruthOptions(estimator="auto", relative_error=0.1, min_count=256, max_count=256)
    """How true the other frames are."""


class SceneErrorOptions(_Seeded):
    """How the frames of a method are compared with the truth's."""

    footprint: RoundFootprint = "geometric_mean"
    """Round footprint that replaces an ellipse where a method answers round footprints only."""
    image: ImageOptions = ImageOptions()
    """How pictures are compared."""


class SceneBenchOptions(SceneErrorOptions, ShotOptions):
    """Scenes that every method renders."""

    frames: int = Field(default=6, ge=3, le=1024)
    """As for `ShotOptions`; aliasing needs three."""
    picture_size: tuple[Side, Side] | None = None
    """Width and height of the pictures on the page, which are rendered besides; left out: those of the frames."""
    names: tuple[str, ...] = ()
    """Scenes of the package, or paths of scenes as `pipeline.scenes.catalogue` reads them."""


class _ViewedOptions(_Seeded):
    view: ViewOptions = ViewOptions()
    """Camera, light and scale."""


class ErrorOptions(_Seeded):
    """Errors on held-out queries."""

    rows: int = Field(default=16_384, ge=64, le=2**24)
    """Most held-out queries of a fabric that errors are measured on."""


class PictureOptions(_ViewedOptions):
    """Pictures of one fabric."""

    views: Annotated[tuple[View, ...], Field(min_length=1, max_length=2)] = ("sphere", "plane")
    """Views that every fabric is shown in by itself."""
    sphere_size: tuple[Side, Side] = (192, 192)
    """Width and height of the sphere's picture, in pixels."""
    plane_size: tuple[Side, Side] = (240, 160)
    """Width and height of the plane's picture, in pixels."""
    truth: TruthOptions = TruthOptions(relative_error=0.05, min_count=256, max_count=512)
    """How true the pictures of the truth are; their noise is subtracted from every figure. Below 256 points a pixel
    may miss one family of yarns altogether, and its standard error with it."""

    def size(self, scene: View) -> tuple[int, int]:
        """Return width and height of a scene's picture, in pixels."""
        return self.sphere_size if scene == "sphere" else self.plane_size


class FrameOptions(_ViewedOptions):
    """Frames of the moving plane, for aliasing."""

    frames: int = Field(default=6, ge=3, le=1024)
    """Frames of the moving plane."""
    frame_size: tuple[Side, Side] = (80, 60)
    """Width and height of those frames, in pixels."""
    frame_truth: TruthOptions = TruthOptions(relative_error=0.1, min_count=256, max_count=256)
    """How true the frames of the truth are."""


class RepeatOptions(Frozen):
    """How often a timed call is repeated."""

    timing_repeats: int = Field(default=25, ge=20, le=10_000)
    """Timed calls of each method, interleaved with those of the others."""
    warm_up: int = Field(default=3, ge=1, le=1000)
    """Calls of each method before the clock counts."""


class TimingOptions(RepeatOptions, ErrorOptions):
    """Times of methods on held-out queries."""

    timing_rows: int = Field(default=4096, ge=64, le=2**24)
    """Queries a fabric in one timed call; fewer of the same for a method that would take longer than
    `reports.measure.timing.LONGEST`."""
    threads: Annotated[tuple[Annotated[int, Field(ge=0, le=1024)], ...], Field(min_length=1, max_length=16)] = (1, 0)
    """Numbers of threads that methods are timed with; 0: one a core of the machine. The fewest are what is compared."""


class RunOptions(Frozen):
    """Ways to use a trained network that are measured beside the network itself."""

    bounds: bool = False
    """Measure every trained network a second time: under the energy bound of `pipeline.models.bounded`, or without it
    if it is bounded by itself. For flat cloth lit from the viewer's side."""
    runtimes: tuple[RuntimeName, ...] = ()
    """Measure every trained network run in these ways too: errors, aliasing and time, of the same weights. What a
    machine cannot run is named on the page with the reason."""


StudyName = Literal[
    "stability", "throughput", "accuracy", "calibration", "bias", "effort", "footprint_colours", "sampling",
    "path_traced", "measured_cloth",
]  # fmt: skip
"""Modules of `reports.truth` that measure the truth, importance sampling, frames in Mitsuba, or fits to real cloth."""

LEAST_TILE: Final = 8
MOST_TILE: Final = 512  # fewest and most pixels along each side of a picture of the truth on a live page


class LiveOptions(Frozen):
    """Live pages of fabrics, as `twillight view` writes them."""

    fabrics: tuple[str, ...] = ()
    """Measured fabrics that the page of the recipe shows live."""
    pixels: int = Field(default=96, ge=LEAST_TILE, le=MOST_TILE)
    """Along each side of their pictures of the truth and of other methods."""


class BenchOptions(RunOptions, TimingOptions, FrameOptions, PictureOptions):
    """One benchmark: errors on held-out queries, pictures, aliasing, timing; on curved cloth the silhouette."""

    latents: bool = True
    """Measure models that blend latents between pairs of presets, and the time of edits."""
    picture_counts: Annotated[tuple[Annotated[int, Field(ge=1, le=4096)], ...], Field(max_length=16)] = (2, 16)
    """Numbers of points k at which `point_sampled` is shown in pictures; tables and plots hold all of them."""
    scenes: SceneBenchOptions = SceneBenchOptions()
    """Scenes with cameras, lights and cloths of their own."""
    live: LiveOptions = LiveOptions()
    """Fabrics that the page shows live."""
    studies: tuple[StudyName, ...] = ()
    """Measurements of the truth itself, of importance sampling, of path-traced frames, and of fits to measured cloth.
    They read no data set."""
    edge: EdgeOptions = EdgeOptions()
    """The silhouette, measured where the data set's queries are of curved cloth."""


def select(kind: type[_Kind], options: Frozen) -> _Kind:
    """Return those of the options that a measurement reads."""
    return kind(**{name: getattr(options, name) for name in kind.model_fields})
