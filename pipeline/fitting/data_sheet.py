"""Data sheets of shades, from TOML or a row of CSV: shares of light at normal incidence, and numbers of the weaver.

    transmittance = 0.124            reflectance_front = 0.845       sett = [18.0, 18.0]     # yarns per cm
    direct_transmittance = 0.002     reflectance_back = 0.845        tex = [30.0, 30.0]      # or ne, or grams
    [solar]                                                          thickness = 0.55        # mm
    transmittance = 0.175                                            draft = "plain"

A face that is left out is as the other one. A transmittance that is left out can be predicted: by the scattering of the
same yarns in white, or from the visible band. Yarns are a diffusing layer of two streams [Kubelka1931Layer] there. With
s the scattering and a = 1 + absorption / scattering, b = sqrt(a^2 - 1):

    R = 1 / (a + b coth(b s))        T = b / (a sinh(b s) + b cosh(b s))

A dye changes the absorption alone, so two cloths of the same yarns share s. In the infrared, s is another.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Final

from pydantic import Field, Strict, model_validator
from scipy.optimize import brentq

from pipeline.fitting.fitted import DRAFTS, Interval
from weaves.count import PerCm
from weaves.errors import BadInput, nearest
from weaves.reading import MOST_TEXT, read_text
from weaves.validation import Frozen, read_toml, validated

VISIBLE_SHARE: Final = 0.45  # share of the sun's energy that the visible band stands for; the rest is infrared
SHEET_NOISE: Final = 0.005  # error of a share that a sheet states

_Share = Annotated[float, Strict(), Field(ge=0.0, le=1.0)]
_Size = Annotated[float, Strict(), Field(gt=0.0)]


class SheetBand(Frozen):
    """Shares of light at normal incidence; together a face sends on at most what arrives."""

    transmittance: _Share | None = None
    direct_transmittance: _Share = 0.0
    reflectance_front: _Share
    reflectance_back: _Share

    @model_validator(mode="before")
    @classmethod
    def _alike(cls, table: Any) -> Any:
        if isinstance(table, Mapping):
            faces = "reflectance_front", "reflectance_back"
            table = {**table, **{face: table[other] for face, other in (faces, faces[::-1]) if other in table}, **table}
        return table

    @model_validator(mode="after")
    def _keeps_energy(self) -> SheetBand:
        through = self.direct_transmittance if self.transmittance is None else self.transmittance
        if self.direct_transmittance > through:
            raise BadInput("", "direct_transmittance", self.direct_transmittance, f"is above the whole, {through:g}")
        if (most := max(self.reflectance_front, self.reflectance_back) + through) > 1.0:
            raise BadInput("", "transmittance", through, f"is {most:.3g} with the reflectance, above 1")
        return self

    @property
    def reflectance(self) -> float:
        """The mean of both faces."""
        return 0.5 * (self.reflectance_front + self.reflectance_back)

    @property
    def scattered(self) -> float:
        """The share that is scattered through; 0 if no transmittance is stated."""
        return 0.0 if self.transmittance is None else self.transmittance - self.direct_transmittance


class DataSheet(SheetBand):
    """A data sheet: its own shares are those of the visible band."""

    name: str = "sheet"
    draft: str = ""
    """One of `pipeline.fitting.fitted.DRAFTS`."""
    openness: Annotated[float, Strict(), Field(ge=0.0, le=0.9)] | None = None
    sett: tuple[PerCm, PerCm] | None = None
    """Ends and picks per cm."""
    tex: tuple[_Size, _Size] | None = None
    """Counts of warp and weft, g/km; `ne`: cotton counts."""
    ne: tuple[_Size, _Size] | None = None
    thickness: _Size | None = None
    """Of the cloth, mm."""
    grams: _Size | None = None
    """Grams a square metre."""
    solar: SheetBand | None = None

    @model_validator(mode="after")
    def _known_draft(self) -> DataSheet:
        if self.draft and self.draft not in DRAFTS:
            raise BadInput("", "draft", self.draft, nearest(self.draft, DRAFTS))
        return self


def read_sheet(path: Path, product: str = "") -> DataSheet:
    """Read a data sheet from TOML, or that of a product from CSV with the columns `product` and `band`.

    BadInput if the file, the product or a number cannot be used, or if more light is sent on than arrives.
    """
    table = read_toml(path) if path.suffix == ".toml" else _csv_row(path, product)
    return validated(DataSheet, table, f"{path} {product}".strip())


def products(path: Path) -> list[str]:
    """Return the products of a CSV file."""
    return list(dict.fromkeys(str(line.get("product")) for line in _lines(path)))


def _lines(path: Path) -> list[dict[str, str]]:
    try:
        return list(csv.DictReader(io.StringIO(read_text(path, MOST_TEXT, "a CSV file"))))
    except FileNotFoundError as error:
        raise BadInput(str(path), "", "no such file", "the path of a data sheet is needed") from error


def _csv_row(path: Path, product: str) -> dict[str, Any]:
    bands: dict[str, dict[str, Any]] = {}
    for line in _lines(path):
        if line.pop("product", None) == product:
            band = line.pop("band", "visible")
            try:
                bands[band] = {key: float(text) for key, text in line.items() if text}
            except ValueError as error:
                raise BadInput(str(path), product, str(error), "numbers are needed") from error
    if "visible" not in bands:
        raise BadInput(str(path), "--row", product, nearest(product, products(path)))
    return {"name": product, **bands.pop("visible"), **bands}


def layer(a: float, scattering: float) -> tuple[float, float]:
    """Return reflectance and transmittance of a layer."""
    b = math.sqrt(max(a * a - 1.0, 1e-12))
    if b * scattering > 300.0:
        return a - b, 0.0
    sinh, cosh = math.sinh(b * scattering), math.cosh(b * scattering)
    whole = a * sinh + b * cosh
    return sinh / whole, b / whole


def scattering_of(reflectance: float, transmittance: float) -> float:
    """Return the scattering of a layer; both shares are above 0 and below 1 together."""
    a = (1.0 + reflectance**2 - transmittance**2) / (2.0 * reflectance)
    b = math.sqrt(max(a * a - 1.0, 1e-12))
    return math.atanh(min(b * reflectance / (1.0 - a * reflectance), 1.0 - 1e-12)) / b


def transmittance_of(reflectance: float, scattering: float) -> float:
    """Return the transmittance of a layer of a reflectance; that of white yarns if these reflect less."""
    if layer(1.0, scattering)[0] <= reflectance:
        return layer(1.0, scattering)[1]
    a = brentq(lambda a: layer(a, scattering)[0] - reflectance, 1.0, 1e4)
    return layer(a, scattering)[1]


def dyed(band: SheetBand, white: SheetBand) -> Interval:
    """Return the transmittance of a band whose yarns scatter like white ones of a known transmittance.

    Both are a diffusing layer beside gaps; the interval has two errors of a sheet in the reflectance.
    """
    gaps, straight = white.direct_transmittance, band.direct_transmittance
    scattering = scattering_of(white.reflectance / (1.0 - gaps), white.scattered / (1.0 - gaps))
    values = [
        straight + (1.0 - straight) * transmittance_of((band.reflectance + step) / (1.0 - straight), scattering)
        for step in (0.0, -2.0 * SHEET_NOISE, 2.0 * SHEET_NOISE)
    ]
    return Interval(values[0], min(values), max(values))


def other_band(sheet: DataSheet, white: DataSheet) -> Interval:
    """Return the solar transmittance of a sheet from its visible band and its solar reflectance.

    Two ways: what is scattered through grows as what is scattered back; or the infrared part is a layer with the
    scattering of white yarns, both of whose bands are known. The value is their mean, the interval has both.
    """
    assert sheet.solar is not None
    grown = sheet.solar.direct_transmittance + sheet.scattered * sheet.solar.reflectance / sheet.reflectance
    layered = dyed(_infrared(sheet), _infrared(white)).value
    ways = grown, VISIBLE_SHARE * (sheet.transmittance or 0.0) + (1.0 - VISIBLE_SHARE) * layered
    return Interval(sum(ways) / 2.0, min(ways) - SHEET_NOISE, max(ways) + SHEET_NOISE)


def _infrared(sheet: DataSheet) -> SheetBand:
    solar = sheet.solar
    assert solar is not None

    def rest(whole: float, part: float) -> float:
        return min(max((whole - VISIBLE_SHARE * part) / (1.0 - VISIBLE_SHARE), 0.0), 1.0)

    scattered, face = rest(solar.scattered, sheet.scattered), rest(solar.reflectance, sheet.reflectance)
    through, straight = solar.direct_transmittance + scattered, solar.direct_transmittance
    return SheetBand(
        transmittance=through, direct_transmittance=straight, reflectance_front=face, reflectance_back=face
    )


def completed(sheet: DataSheet, white: DataSheet | None) -> tuple[DataSheet, list[str]]:
    """Return a sheet with the transmittances that it lacks, and sentences on them; without white yarns none scatter."""
    remarks, bands = [], {"visible": (sheet, white), "solar": (sheet.solar, white and white.solar)}
    for key, (band, like) in bands.items():
        if band is None or band.transmittance is not None:
            continue
        if like is not None and like.transmittance is not None:
            guess, way = dyed(band, like), "by the scattering of the white yarns"
        else:
            straight = band.direct_transmittance
            guess = Interval(straight, straight, 1.0 - band.reflectance)
            way = "what goes straight: --like names white yarns"
        remarks.append(f"Transmittance, {key}: {guess.value:.3f} ({guess.low:.3f} to {guess.high:.3f}), {way}.")
        update = {"transmittance": guess.value}
        sheet = sheet.model_copy(update=update if key == "visible" else {"solar": band.model_copy(update=update)})
    return sheet, remarks
