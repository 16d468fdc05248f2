"""Weavers' numbers: widths of yarns from counts and sett, and cover, openness and cut-off angles of the cloth.

A count is the mass of a yarn for its length, a sett the number of yarns for the width of the cloth. With T in tex (g
a kilometre), the density rho of the fibre in g/cm^3, the packing phi (fibre volume over yarn volume) and n yarns a cm:

    tex = 590.54 / Ne                            Ne: cotton count, hanks of 840 yards a pound
    d = sqrt(4 T / (1000 pi rho phi))            diameter in mm of a round yarn
    width = d n / 10                             in yarn spacings: the fractional cover of one family of yarns

The usual phi = .6 and cotton's rho = 1.52 give the diameter of [Peirce1937Cloth], 1 / (28 sqrt(Ne)) inches. With the
widths a (warp) and b (weft) the cloth covers a + b - a b of its area; its openness, (1 - a)(1 - b), is the rest. Light
that is inclined along the warp passes between two wefts, ellipses b wide and relief times b high, up to the angle

    tan(angle) = sqrt(1 - b^2) / (relief b)      cos(angle) = b for round yarns

from the normal: the cut-off angle along the warp. That along the weft is the same of a, the tangent along a diagonal
sqrt(2) times the smaller one. Yarns are taken as straight.
"""

import math
from collections.abc import Mapping
from typing import Annotated, Any, Final, NamedTuple

from pydantic import Field, Strict

from weaves.errors import BadInput
from weaves.validation import Frozen, validated
from weaves.yarn import NARROWEST_YARN, Yarn

PerCm = Annotated[float, Strict(), Field(ge=0.1, le=1000)]  # yarns per centimetre

TEX_TIMES_NE: Final = 1e3 * 453.59237 / (840 * 0.9144)
"""Product of a yarn's counts in tex and in Ne: grams a pound and metres a hank."""


class Count(Frozen):
    """A yarn by its count, in place of its width."""

    tex: Annotated[float, Strict()] | None = Field(default=None, ge=0.1, le=10000)  # grams a kilometre
    ne: Annotated[float, Strict()] | None = Field(default=None, ge=0.1, le=1000)  # cotton count
    fibre_density: Annotated[float, Strict()] = Field(default=1.52, ge=0.5, le=20)
    """Density of the fibre, g/cm^3: cotton 1.52, wool 1.31, silk 1.34, flax 1.5, polyester 1.38, polyamide 1.14."""
    packing: Annotated[float, Strict()] = Field(default=0.6, ge=0.1, le=0.91)
    """Share of the yarn's volume that is fibre: .6 for spun yarns, more for filaments."""

    @property
    def diameter(self) -> float:
        """Diameter in mm; `tex` or `ne` must be given."""
        tex = self.tex if self.tex is not None else TEX_TIMES_NE / (self.ne or math.nan)
        return math.sqrt(4.0 * tex / (1e3 * math.pi * self.fibre_density * self.packing))


class _Sett(Frozen):
    sett: tuple[PerCm, PerCm]


def with_widths(table: Mapping[str, Any]) -> dict[str, Any]:
    """Return the table of a fabric with `yarns_per_cm` in place of `sett`, and widths in place of counts.

    BadInput for a number out of its range, a count without a sett or beside a width or a second count, and yarns that
    would be wider than their spacing.
    """
    read = dict(table)
    if "sett" in read:
        if "yarns_per_cm" in read:
            raise BadInput("", "sett", read["sett"], "yarns_per_cm states the same; give one of the two")
        read["yarns_per_cm"] = validated(_Sett, {"sett": read.pop("sett")}, "").sett
    for axis, family in enumerate(("warp", "weft")):
        yarn = read.get(family)
        if isinstance(yarn, Mapping) and (given := {key: yarn[key] for key in Count.model_fields if key in yarn}):
            try:
                width = _width(given, yarn, read.get("yarns_per_cm"), axis)
            except BadInput as error:
                raise BadInput("", f"{family}.{error.key}", error.value, error.allowed) from error
            read[family] = {key: value for key, value in yarn.items() if key not in given} | {"width": width}
    return read


def _width(given: dict[str, Any], yarn: Mapping[str, Any], per_cm: Any, axis: int) -> float:
    count = validated(Count, given, "")
    key = next(iter(given))
    if (count.tex is None) == (count.ne is None):
        raise BadInput("", key, given[key], "give exactly one of tex and ne")
    if "width" in yarn:
        raise BadInput("", "width", yarn["width"], f"follows from {key} and sett; leave it or {key} out")
    if per_cm is None:
        raise BadInput("", key, given[key], "sett = [ends per cm, picks per cm] is needed with it")
    try:
        yarns = validated(_Sett, {"sett": per_cm}, "").sett[axis]
    except BadInput:
        return 1.0  # the fabric says what is wrong with its yarns_per_cm
    width = count.diameter * yarns / 10.0
    if not NARROWEST_YARN <= width <= 1.0:
        sett = f"{yarns:g} {('ends', 'picks')[axis]} per cm"
        wide = f"at {sett} yarns of {count.diameter:.3g} mm have {width:.3g} of their spacing"
        least, most = (10.0 * share / count.diameter for share in (NARROWEST_YARN, 1.0))
        allowed = f"{wide}; with this count the sett may be from {least:.3g} to {most:.3g}"
        raise BadInput("", key, given[key], allowed + (", or more with a larger packing" if width > 1.0 else ""))
    return width


class Cover(NamedTuple):
    """How closely a cloth is woven."""

    warp: float  # share of the area that the warp covers, 0 to 1
    weft: float  # share that the weft covers
    cloth: float  # share that either covers
    openness: float  # share of the gaps
    cut_off_along_warp: float
    """Angle to the normal, in degrees, from which on no light inclined along the warp passes straight; 0: none does."""
    cut_off_along_weft: float
    cut_off_along_diagonals: float


def cover(warp: Yarn, weft: Yarn) -> Cover:
    """Return the cover factors, the openness and the cut-off angles of a cloth."""
    openness = (1.0 - warp.width) * (1.0 - weft.width)
    tangents = [(openness > 0) * math.sqrt(1 - yarn.width**2) / (yarn.relief * yarn.width) for yarn in (weft, warp)]
    angles = (math.degrees(math.atan(tangent)) for tangent in (*tangents, math.sqrt(2.0) * min(tangents)))
    return Cover(warp.width, weft.width, 1.0 - openness, openness, *angles)
