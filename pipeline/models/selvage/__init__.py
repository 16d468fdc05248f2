"""`selvage`: soft nodes corrected by one small network for all fabrics; its options."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field

from pipeline.models.analytic.soft_nodes import Level
from pipeline.models.options import Gaussian, Options
from pipeline.truth.options import Walls


class SelvageOptions(Options):
    """Soft nodes corrected by a residual perceptron: one network for many fabrics and scales; own design."""

    fixed: ClassVar[tuple[str, ...]] = (
        "layers",
        "finest",
        "dark",
        "error_weight",
        "specular_colour",
        "diffuse_colour",
        "colour_weight",
    )
    seconds: ClassVar[tuple[float, float]] = (2e-5, 2.5e-6)
    prepare_seconds: ClassVar[float] = 1.2
    without_training: ClassVar[frozenset[str]] = frozenset({"stretch", "behind", "curvature"})
    answers_outside: ClassVar[bool] = True
    estimates_errors: ClassVar[bool] = True
    turns: ClassVar[bool] = True

    model: Literal["selvage"] = "selvage"
    width: Literal[16, 32, 64] = 64
    """Width of the hidden layers."""
    level: Level = 2
    """Level of detail of its soft nodes."""
    error_width: Literal[16, 32, 64] = 32
    """Width of the hidden layer of the network that estimates errors."""
    exchange: bool = True
    """Exchange warp and weft in a random half of the training steps."""
    measured_rows: int = Field(default=1024, ge=16, le=2**20)
    """Queries of each training fabric over which features are normalised to mean 0 and deviation 1."""
    bound: bool = True
    """Bound each component by the answer of the soft nodes without shadows: no diffuse light is then gained."""
    footprint: Gaussian = "gaussian"
    parallax: Literal[True] = True
    """The footprints of its soft nodes are patches of view rays."""
    walls: Walls = "rim"
    """Meaning of a view ray that meets a wall; must be that of the truth."""

    layers: ClassVar[int] = 2
    """Hidden layers."""
    finest: ClassVar[Level] = 8
    """Level of detail of the soft nodes whose error is estimated beside its own."""
    dark: ClassVar[float] = 0.1
    """Colour well above which squared errors are divided by the colour, and well below which they are not."""
    error_weight: ClassVar[float] = 1e-5
    """Weight of the loss of the estimated errors, which share no weights with the correction."""
    specular_colour: ClassVar[float] = 0.3
    """Colour of the specular components in the loss."""
    diffuse_colour: ClassVar[float] = 0.5
    """Colour of the diffuse components in the loss."""
    colour_weight: ClassVar[float] = 1.0
    """Weight of the squared error of the whole colour beside those of the components."""

    @property
    def rims(self) -> bool:
        """True if view rays that meet a wall see a rim."""
        return self.walls == "rim"

    @property
    def kinds(self) -> frozenset[str]:
        """Footprints of any shape: the soft nodes weigh an ellipse, not the network."""
        return frozenset({"stretch"})
