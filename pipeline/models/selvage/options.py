"""Options of `selvage`: the correcting network, its loss, and what it leaves to a rule."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field, model_validator

from pipeline.models.options import Name, Options, Weight


class SelvageOptions(Options):
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
    colour_weight: Weight = 1.0
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

    @property
    def kinds(self) -> frozenset[str]:
        """Footprints of any shape: what an ellipse weighs is the sums' business, not the network's."""
        return frozenset({"stretch"})
