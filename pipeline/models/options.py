"""Base class of the options of all models, and the types of fields that several models have.

Fields are declared by each model, in its own order: a base would move them to the front of every card.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, Self

from pydantic import BaseModel, ConfigDict, Field

from pipeline import versions
from pipeline.shards.extra_rows import ExtraRows

Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$", max_length=64)]
"""A name that is valid in file names and task ids."""

Gaussian = Annotated[Literal["gaussian"], Field(description="Kernel it knows; must be the kernel of the truth.")]
"""The footprint of a method that knows one kernel."""

LogK = Annotated[float, Field(gt=0, le=1e4, description="k of the specular space g(x) = ln(k x + 1).")]
"""Strength of the logarithmic compression of highlights in the loss (`pipeline.models.networks.losses`)."""

Weight = Annotated[float, Field(ge=0, le=1e4)]
"""A factor of one term of a loss."""


RoundFootprint = Literal["geometric_mean", "major"]
"""Round footprint in place of an ellipse: of equal area, or with its major axis."""


class Options(BaseModel):
    """Options of a model; each has the fields ``model``, the name of its folder, and ``name``, its name in tables."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True)

    if TYPE_CHECKING:

        @property
        def model(self) -> str:
            """Name of the model's folder."""

        @property
        def name(self) -> str:
            """Name in tables and files."""

    learns: ClassVar[bool] = True
    """True if the model is trained."""
    of_one_material: ClassVar[bool] = False
    """True if a trained model knows a single fabric."""
    blends: ClassVar[bool] = False
    """True if blended latents of two fabrics give the fabrics between them."""
    any_physics: ClassVar[bool] = False
    """True if it can learn any physics of the truth (frame, normaliser, shadows); else only the default."""
    seconds: ClassVar[tuple[float, float]] = (2e-5, 3e-6)
    """Estimate of the time of one query in training and in prediction, on one core of a server of 2022."""

    @property
    def version(self) -> int:
        """Version of the model's numbers (`pipeline.versions`)."""
        return versions.MODELS.get(self.model, 1)

    @property
    def departures(self) -> tuple[str, ...]:
        """Deviations from the published method, for the page."""
        return ()

    @property
    def kinds(self) -> frozenset[str]:
        """Kinds of queries that it evaluates, of `behind`, `stretch` and `curvature` (`QueryOptions`)."""
        return frozenset()

    @property
    def extra_rows(self) -> tuple[ExtraRows, ...]:
        """Sets of rows that a training reads beside the data set's own; each becomes shards of its fabrics."""
        return ()

    without_training: ClassVar[frozenset[str]] = frozenset()
    """Kinds of queries that it evaluates though no training has them, of `behind`, `stretch` and `curvature`."""
    answers_outside: ClassVar[bool] = False
    """True if it evaluates queries outside its domain too, in another way than those within."""

    estimates_errors: ClassVar[bool] = False
    """True if its methods have a function ``within(error)`` that returns the method at a wished error."""

    turns: ClassVar[bool] = False
    """True if it evaluates a viewer behind the cloth as one in front of the cloth's back, which is a fabric too."""

    parameter: ClassVar[str] = ""
    """Name of the field with the settings k, which trade speed for accuracy; empty if there is none."""

    @property
    def settings(self) -> tuple[int, ...]:
        """Settings k, each a method of its own named ``k = ...``; empty for a model without them.

        The seconds of a prediction are those of k = 1.
        """
        return tuple(getattr(self, self.parameter)) if self.parameter else ()

    @property
    def variant(self) -> str:
        """Setting of the only method of a model without settings."""
        return ""

    def single(self) -> list[Self]:
        """Return options with one setting each: one for every k, or these if the model has no settings."""
        if not self.parameter:
            return [self]
        return [self.model_copy(update={self.parameter: [k]}) for k in self.settings]
