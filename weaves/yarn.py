"""Yarns: twisted bundles of fibres, the same for all warps of a fabric, and for all wefts.

Geometry after [Irawan2012Woven]: a float is a piece of torus, `bend` its largest inclination, `twist` the angle of the
fibres to the yarn's axis. Optics after [Wang2022SpongeCake]: fibre-like microflakes of roughness alpha over a diffuse
base.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, Strict, model_validator

from weaves.colour import Colour, Rgb, linear_rgb
from weaves.validation import Frozen

Number = Annotated[float, Strict()]


class Yarn(Frozen):
    """One family of yarns, warp or weft."""

    width: Number = Field(default=1.0, ge=0.05, le=1)
    """Gap scale g: width of the yarn in yarn spacings; below 1 the cloth has gaps."""
    bend: Number = Field(ge=0, le=85)
    """Largest inclination of a float, u_max, in degrees; 0 is drawn flat."""
    twist: Number = Field(default=0.0, ge=-89, le=89)
    """Angle of the fibres to the yarn's axis, psi, in degrees."""
    roughness: Number = Field(ge=0.01, le=1)
    """Microflake roughness alpha: small is lustrous."""
    relief: Number = Field(default=1.0, ge=0.01, le=2)
    """Scale of the height field, beta."""
    blend: Number = Field(default=0.5, ge=0, le=1)
    """Weight w_d of the ply normal in the diffuse cosine; the macro normal has the rest."""
    specular: Colour = (0.3, 0.3, 0.3)
    """Colour k_s of the light scattered once by the fibres."""
    diffuse: Colour = (0.3, 0.3, 0.3)
    """Colour k_d of the light scattered many times and sent back."""
    diffuse_transmission: Colour = (0.0, 0.0, 0.0)
    """Colour k_dt of the light scattered many times that leaves on the other side; k_d + k_dt is at most 1."""

    @property
    def specular_rgb(self) -> Rgb:
        """k_s in linear sRGB."""
        return linear_rgb(self.specular)

    @property
    def diffuse_rgb(self) -> Rgb:
        """k_d in linear sRGB."""
        return linear_rgb(self.diffuse)

    @property
    def diffuse_transmission_rgb(self) -> Rgb:
        """k_dt in linear sRGB."""
        return linear_rgb(self.diffuse_transmission)

    @model_validator(mode="after")
    def _keeps_energy(self) -> Yarn:
        channels = zip(self.diffuse_rgb, self.diffuse_transmission_rgb, strict=True)
        if any(back + through > 1.0 + 1e-9 for back, through in channels):
            raise ValueError("diffuse + diffuse_transmission must be at most 1 in every channel: no yarn makes light")
        return self

    def optics(self) -> dict[str, float]:
        """Return the numbers that shape the four components: all but the colours."""
        return {name: getattr(self, name) for name in ("width", "bend", "twist", "roughness", "relief", "blend")}
