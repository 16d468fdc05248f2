"""Colours of yarns in linear sRGB, read from RGB, sRGB hex or a reflectance spectrum.

Also for pictures: the sRGB encoding and the colour difference CIEDE2000.

The conversions are those of colour-science, imported only when a colour is not already linear RGB. Spectra are seen by
the CIE 1931 2° observer under D65, and colours outside the sRGB gamut are clipped to it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import lru_cache
from typing import Annotated, Any, Final

import numpy as np
import numpy.typing as npt
from pydantic import AfterValidator, Discriminator, Field, Strict, Tag, model_validator

from weaves.validation import Frozen

Unit = Annotated[float, Strict(), Field(ge=0, le=1, allow_inf_nan=False)]
Rgb = tuple[float, float, float]

EXPECTED = 'a colour is three numbers from 0 to 1 (linear RGB), "#rrggbb" (sRGB), or a spectrum { wavelengths, values }'
EXPOSURE: Final = 1.6  # factor on linear values before pictures show them
LUMINANCE: Final = (0.2126, 0.7152, 0.0722)  # luminance of linear sRGB primaries (Rec. 709)


class Spectrum(Frozen):
    """A reflectance spectrum: linear between the samples, constant beyond them."""

    wavelengths: tuple[Annotated[float, Strict(), Field(ge=200, le=2000, allow_inf_nan=False)], ...] = Field(
        min_length=2, max_length=1000
    )
    """In nanometres, rising."""
    values: tuple[Unit, ...] = Field(min_length=2, max_length=1000)  # reflectance at each wavelength

    @model_validator(mode="after")
    def _sampled(self) -> Spectrum:
        if len(self.wavelengths) != len(self.values):
            raise ValueError(f"{len(self.wavelengths)} wavelengths need as many values, not {len(self.values)}")
        if any(after <= before for before, after in zip(self.wavelengths, self.wavelengths[1:], strict=False)):
            raise ValueError("wavelengths must rise")
        return self


def _hex(value: str) -> str:
    if not re.fullmatch(r"#[0-9a-fA-F]{6}", value):
        raise ValueError(EXPECTED)
    return value


def _notation(value: Any) -> str | None:
    """Return which of the three notations a value uses; None if none."""
    if isinstance(value, str):
        return "hex"
    if isinstance(value, Spectrum | Mapping):
        return "spectrum"
    return "rgb" if isinstance(value, list | tuple) and len(value) == 3 else None


Colour = Annotated[
    Annotated[tuple[Unit, Unit, Unit], Tag("rgb")]
    | Annotated[str, AfterValidator(_hex), Tag("hex")]
    | Annotated[Spectrum, Tag("spectrum")],
    Discriminator(_notation, custom_error_type="colour", custom_error_message=EXPECTED),
]


def luminance(rgb: Rgb) -> float:
    """Return the luminance of a linear sRGB colour."""
    return sum(weight * value for weight, value in zip(LUMINANCE, rgb, strict=True))


@lru_cache(maxsize=1024)
def linear_rgb(colour: Rgb | str | Spectrum) -> Rgb:
    """Convert a colour, as `Colour` allows it, to linear sRGB, each channel from 0 to 1."""
    if isinstance(colour, tuple):
        return colour
    import colour as science

    if isinstance(colour, str):
        rgb = science.models.eotf_sRGB(science.notation.HEX_to_RGB(colour))
    else:
        shape = science.SpectralShape(360, 780, 1)
        reflectance = np.interp(shape.wavelengths, colour.wavelengths, colour.values)
        observer = science.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(shape)
        daylight = science.SDS_ILLUMINANTS["D65"].copy().align(shape)
        seen = science.sd_to_XYZ(science.SpectralDistribution(reflectance, shape.wavelengths), observer, daylight)
        rgb = science.XYZ_to_sRGB(seen / 100, apply_cctf_encoding=False)
    red, green, blue = np.clip(rgb, 0, 1).tolist()
    return red, green, blue


def encoded(rgb: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Return the sRGB encoding of linear values (IEC 61966-2-1), both from 0 to 1, in their shape."""
    import colour as science

    return np.asarray(science.models.eotf_inverse_sRGB(np.asarray(rgb, np.float64)), np.float64)


def decoded(codes: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Return the linear values of an sRGB encoding, the inverse of `encoded`."""
    import colour as science

    return np.asarray(science.models.eotf_sRGB(np.asarray(codes, np.float64)), np.float64)


def delta_e(rgb: npt.ArrayLike, reference: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Return the colour differences CIEDE2000 (...) of linear sRGB colours (..., 3) of a display with white (1, 1, 1).

    By way of XYZ (Rec. 709 primaries) and L*a*b* under D65, all parametric factors 1; about 1 is just noticeable
    [Sharma2005CIEDE2000].
    """
    import colour as science

    white = science.CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"]["D65"]
    lab, other = (
        science.XYZ_to_Lab(science.sRGB_to_XYZ(np.asarray(values, np.float64), apply_cctf_decoding=False), white)
        for values in (rgb, reference)
    )
    return np.asarray(science.delta_E(lab, other, method="CIE 2000"), np.float64)
