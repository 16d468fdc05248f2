"""Yarns: twisted bundles of fibres, the same for all warps of a fabric, and for all wefts.

Geometry after [Irawan2012Woven]: a float is a piece of torus, `bend` its largest inclination, `twist` the angle of the
fibres to the yarn's axis. Optics after [Wang2022SpongeCake]: fibre-like microflakes of roughness alpha over a diffuse
base.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, Strict

from weaves.colour import Colour, Rgb, linear_rgb

Number = Annotated[float, Strict()]


class Yarn(BaseModel):
    """One family of yarns, warp or weft."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True)

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
    """Colour k_d of the light scattered many times."""

    @property
    def specular_rgb(self) -> Rgb:
        """k_s in linear sRGB."""
        return linear_rgb(self.specular)

    @property
    def diffuse_rgb(self) -> Rgb:
        """k_d in linear sRGB."""
        return linear_rgb(self.diffuse)

    def optics(self) -> dict[str, float]:
        """Return the numbers that shape the four components: all but the colours."""
        return {
            "width": self.width,
            "bend": self.bend,
            "twist": self.twist,
            "roughness": self.roughness,
            "relief": self.relief,
            "blend": self.blend,
        }
