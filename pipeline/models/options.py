"""What the options of all models share: what a model says of itself, and the fields that several of them have.

Fields are declared by each model, in its own order: a base would move them to the front of every card.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, Self

from pydantic import BaseModel, ConfigDict, Field

from pipeline import versions

Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$", max_length=64)]
"""A name that can stand in a file name and in a task id."""

Gaussian = Annotated[Literal["gaussian"], Field(description="Kernel it knows; must be the kernel of the truth.")]
"""The footprint of a method that knows one kernel."""

LogK = Annotated[float, Field(gt=0, le=1e4, description="k of the specular space g(x) = ln(k x + 1).")]
"""How far highlights are squeezed before they are learnt (`pipeline.models.networks.losses`)."""

Weight = Annotated[float, Field(ge=0, le=1e4)]
"""A factor of one term of a loss."""


RoundFootprint = Literal["geometric_mean", "major"]
"""Round footprint that stands for an ellipse: of the same area, or of its major axis."""


class Options(BaseModel):
    """What every model says of itself; each has a field ``model``, its file's name, and a field ``name``, its own."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True)

    if TYPE_CHECKING:

        @property
        def model(self) -> str:
            """Name of the model's folder."""

        @property
        def name(self) -> str:
            """Name in tables and files."""

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
    def version(self) -> int:
        """Version of the model's numbers (`pipeline.versions`)."""
        return versions.MODELS.get(self.model, 1)

    @property
    def departures(self) -> tuple[str, ...]:
        """What is not as published, in words for the page."""
        return ()

    @property
    def kinds(self) -> frozenset[str]:
        """Which of `behind`, `stretch` and `curvature` (`QueryOptions`) its queries may have."""
        return frozenset()

    knob: ClassVar[str] = ""
    """Name of the field that holds the values of the speed-accuracy knob; empty if there is none."""

    @property
    def knobs(self) -> tuple[int, ...]:
        """Values k of the speed-accuracy knob, each a method of its own with the setting ``k = ...``; none: one method.

        The seconds of a prediction are then those of k = 1.
        """
        return tuple(getattr(self, self.knob)) if self.knob else ()

    def single(self) -> list[Self]:
        """Return options of one setting each: these, or for every value of the knob these with that value alone."""
        return [self.model_copy(update={self.knob: [value]}) for value in self.knobs] if self.knob else [self]
