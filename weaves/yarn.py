"""Yarns: twisted bundles of fibres, the same for all warps of a fabric, and for all wefts.

Geometry after [Irawan2012Woven]: a float is a piece of torus, `bend` its largest inclination, `twist` the angle of the
fibres to the yarn's axis. Optics after [Wang2022SpongeCake]: fibre-like microflakes of roughness alpha, a diffuse base.

No yarn makes light. In even light of radiance 1 from everywhere, a viewer of a point of a yarn sees

    exp(-T Lambda) + k_s s + k_d a + k_dt b,    Lambda = sigma(wo) / <wo.n_p> >= 1, the tangent being normal to n_p

straight through, scattered once by a layer of optical thickness T (s if it is white, reflected and transmitted), and
diffuse, whose cosines integrate to a, b <= 1. With x = exp(-T), a white layer without a diffuse base shows at most

    exp(-T Lambda) + s <= 1 - (1 - x)^2 (1 + 3/2 x) / 2

to all viewers at all roughness: at most .04 too much, found by integration over wi. The sum is linear in k_s, and is x
at most for k_s = 0. So it is at most 1 for

    k_d + k_dt <= (1 - x) (1 - k_s (1/2 - x/4 + 3/4 x^2))

in every channel, which is `Yarn.most_diffuse`. A patch is a mean of points, and in gaps the sum is 1. Light that yarns
give to each other adds to no radiance above 1, as each gives at most what it sees. (Cosines are those of frame = "ply".
Summed over viewers, what a repeat reflects of one light is bounded alike; the diffuse lobe of light from behind is not
reciprocal and may exceed 1: it has 2.5 for light at 88 degrees behind a satin bent by 2 degrees.)
"""

import math
from typing import Annotated, Final, cast

from pydantic import Field, Strict

from weaves.colour import Colour, Rgb, linear_rgb
from weaves.errors import BadInput
from weaves.validation import Frozen

Number = Annotated[float, Strict()]

NARROWEST_YARN: Final = 0.05  # least width of a yarn, in yarn spacings
_ROUNDING = 1e-9  # of sums of colours


class Yarn(Frozen):
    """One family of yarns, warp or weft."""

    also_read = ("tex", "ne", "fibre_density", "packing")

    width: Number = Field(default=1.0, ge=NARROWEST_YARN, le=1)
    """Gap scale g: width of the yarn in yarn spacings; below 1 the cloth has gaps."""
    bend: Number = Field(ge=0, le=85)  # largest inclination of a float, u_max, in degrees; 0 is drawn flat
    twist: Number = Field(default=0.0, ge=-89, le=89)  # angle of the fibres to the yarn's axis, psi, in degrees
    roughness: Number = Field(ge=0.01, le=1)  # microflake roughness alpha: small is lustrous
    relief: Number = Field(default=1.0, ge=0.01, le=2)  # scale of the height field, beta
    blend: Number = Field(default=0.5, ge=0, le=1)
    """Weight of the ply normal in the diffuse cosine: w_d, or 1 - w_d if that of a paper weighs the macro normal."""
    specular: Colour = (0.3, 0.3, 0.3)  # colour k_s of the light scattered once by the fibres
    diffuse: Colour = (0.3, 0.3, 0.3)  # colour k_d of the light scattered many times and sent back
    diffuse_transmission: Colour = (0.0, 0.0, 0.0)
    """Colour k_dt of the light scattered many times that leaves on the other side."""

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

    def most_diffuse(self, thickness: float) -> Rgb:
        """Return the largest k_d + k_dt with which the yarn makes no light, at an optical thickness of its layer."""
        straight = math.exp(-thickness)
        once = 0.5 - 0.25 * straight + 0.75 * straight * straight
        return cast(Rgb, tuple((1.0 - straight) * (1.0 - k * once) for k in self.specular_rgb))

    def refuse_gain(self, thickness: float) -> None:
        """Refuse colours with which the yarn would send out more light than it receives; BadInput names `diffuse`."""
        channels = zip(("red", "green", "blue"), self.most_diffuse(thickness), self.specular_rgb, strict=True)
        diffuse = zip(self.diffuse_rgb, self.diffuse_transmission_rgb, strict=True)
        for (name, most, specular), (back, through) in zip(channels, diffuse, strict=True):
            if back + through > most + _ROUNDING:
                others = f"specular {specular:.4g} and optical_thickness {thickness:g}"
                sum_of = "diffuse + diffuse_transmission" if through else "it"
                allowed = f"with {others}, {sum_of} may be at most {math.floor(1e4 * most) / 1e4:g} in {name}"
                raise BadInput("yarn", "diffuse", self.diffuse, f"{allowed}: no yarn makes light")

    def optics(self) -> dict[str, float]:
        """Return the numbers that shape the four components: all but the colours."""
        return {name: getattr(self, name) for name in ("width", "bend", "twist", "roughness", "relief", "blend")}
