"""Options that several models have: of all, of networks whose loss is that of components, of textures."""

from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, SerializationInfo, SerializerFunctionWrapHandler, model_serializer, model_validator

from pipeline import versions
from pipeline.fingerprint import IDENTITY
from pipeline.shards.generate import ExtraRows
from weaves.validation import FileName, Frozen

Gaussian = Annotated[Literal["gaussian"], Field(description="Kernel it knows; must be the kernel of the truth.")]
"""The footprint of a method that knows one kernel."""

Weight = Annotated[float, Field(ge=0, le=1e4)]  # a factor of one term of a loss


RoundFootprint = Literal["geometric_mean", "major"]
"""Round footprint in place of an ellipse: of equal area, or with its major axis."""


class Design(Frozen):
    """A design: options, and choices that are no options but part of its identity."""

    fixed: ClassVar[tuple[str, ...]] = ()
    """Names of the choices of its design that are no options; identities and cards state them beside the options."""

    @model_validator(mode="before")
    @classmethod
    def _without_fixed(cls, given: Any) -> Any:
        """Accept choices that a card states, if they are those of this version."""
        if not isinstance(given, dict):
            return given
        return {key: value for key, value in given.items() if key not in cls.fixed or value != getattr(cls, key)}

    @model_serializer(mode="wrap")
    def _identified(self, dump: SerializerFunctionWrapHandler, info: SerializationInfo) -> dict[str, Any]:
        """Return the options; as an identity with all choices of the design."""
        content: dict[str, Any] = dump(self)
        if info.context == IDENTITY:
            content |= {key: getattr(self, key) for key in self.fixed}
        return content


class Options(Design):
    """Options of a model."""

    model: str = ""
    """Name of its folder or file in `pipeline.models`."""
    name: FileName = Field(default_factory=lambda options: options["model"])
    """Name in tables and files, and of the trained model."""

    learns: ClassVar[bool] = True  # true if the model is trained
    of_one_material: ClassVar[bool] = False  # true if a trained model knows a single fabric
    blends: ClassVar[bool] = False  # true if blended latents of two fabrics give the fabrics between them
    encodes: ClassVar[bool] = False  # true if it encodes samples of any fabric
    any_physics: ClassVar[bool] = False
    """True if it can learn any physics of the truth (`pipeline.models.domain.PHYSICS`); else only the default, and what
    it has an option for."""
    seconds: ClassVar[tuple[float, float]] = (2.4e-5, 3e-6)
    """Estimate of the time of one query in training and in prediction, on one core of a server of 2022."""
    prepare_seconds: ClassVar[float] = 0.1  # estimate of the time until a fabric can be evaluated

    @property
    def version(self) -> int:
        """Version of the model's numbers (`pipeline.versions`)."""
        return versions.MODELS.get(self.model, 1)

    departures: ClassVar[tuple[str, ...]] = ()  # deviations from the published method, for the page
    extra_rows: ClassVar[tuple[ExtraRows, ...]] = ()
    """Sets of rows that a training reads beside the data set's own; each becomes shards of its fabrics."""
    variant: ClassVar[str] = ""  # setting of the only method of a model without settings
    kinds: ClassVar[frozenset[str]] = frozenset()
    """Kinds of queries that it evaluates, of `behind`, `stretch` and `curvature` (`QueryOptions`)."""
    turns: ClassVar[bool] = False
    """True if it evaluates a viewer behind the cloth as one in front of the cloth's back, which is a fabric too."""

    parameter: ClassVar[str] = ""
    """Name of the field with the settings k, which trade speed for accuracy; empty if there is none."""
    usual_setting: ClassVar[float | None] = None
    """Setting of a method that is named without one; None: the last, which is the most accurate."""
    settings_allowed: ClassVar[str] = "a number k after the colon is needed, such as :4"
    """Form of a setting on a command line, for messages."""

    @property
    def settings(self) -> tuple[float, ...]:
        """Settings k, each a method of its own; empty for a model without them."""
        return tuple(getattr(self, self.parameter)) if self.parameter else ()

    @property
    def work(self) -> float:
        """Work of all settings, in units of what a prediction takes `seconds` for: that of k = 1."""
        return sum(self.settings) or 1.0

    @classmethod
    def read_setting(cls, text: str) -> float:
        """Return the setting that a text on a command line names; ValueError if it names none."""
        if not text.isdecimal() or len(text) > 6:
            raise ValueError(text)
        return int(text)

    @classmethod
    def setting_of(cls, setting: float) -> str:
        """Return the text of a setting in Records, tables and names of files."""
        return f"k = {setting}"

    def single(self) -> list[Self]:
        """Return options with one setting each: one for every k, or these if the model has no settings."""
        if not self.parameter:
            return [self]
        return [self.model_copy(update={self.parameter: [k]}) for k in self.settings]


class ComponentLossOptions(Options):
    """Options of a network that learns the four components in log space (`pipeline.models.networks.layers`)."""

    fixed: ClassVar[tuple[str, ...]] = ("specular_weight",)

    log_k: float = Field(default=3.0, gt=0, le=1e4)
    """k of the specular space g(x) = ln(k x + 1), which compresses highlights in the loss."""
    diffuse_weight: Weight = 2.0
    """Weight of the diffuse squared error; equal weights starve it."""

    specular_weight: ClassVar[float] = 1.0
    """Weight of the specular squared error, taken in log space."""


class TextureOptions(ComponentLossOptions):
    """Options of textures and perceptrons of one fabric, and of how they are trained."""

    of_one_material: ClassVar[bool] = True
    fixed: ClassVar[tuple[str, ...]] = (
        *ComponentLossOptions.fixed, "channels", "texture_rate", "blur_halving", "offset_frozen"
    )  # fmt: skip

    texels_per_yarn: int = Field(default=16, ge=1, le=256)
    """Texels of the finest level along one yarn spacing; textures hold one repeat and wrap."""
    levels: int = Field(default=0, ge=0, le=12)
    """Levels of the pyramids, each half as fine as the one before; 0 means down to one texel."""
    hidden: int = Field(default=25, ge=4, le=256)
    """Width of the three hidden layers of all perceptrons."""
    offset: bool = True
    """Shift the centre along the view by a learnt depth before the look-up, as parallax does."""
    blur: float = Field(default=8.0, ge=0, le=64)
    """Standard deviation, in finest texels, of the Gaussian blur on the textures at the first step; 0 means none."""

    channels: ClassVar[int] = 7  # channels of every texture; `curved` does not say
    texture_rate: ClassVar[float] = 3.0
    """Learning rate of the textures relative to that of the perceptrons: short trainings touch each texel rarely."""
    blur_halving: ClassVar[float] = 0.11
    """Share of the training after which the blur has halved (`neumip`: 3,333 of 30,000 iterations)."""
    offset_frozen: ClassVar[float] = 0.33
    """Share of the training after which the offset texture is held fixed (`neumip`: 10,000 of 30,000 iterations)."""
