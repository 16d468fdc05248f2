"""Predictions of what a fit was not given, beside rivals.

Rings of a BSDF are left out in turn: all light of one angle to the normal is predicted by a fit to the others. Rivals
are formulas in use for light straight through shades, with the openness as their only number. Angles are in degrees:
theta to the normal, profile angles those of the direction's projections onto the planes across warp and weft.
"""

import math
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from pipeline.bsdf.klems import Scattering
from pipeline.compiled.arrays import Float64, Mask
from pipeline.fitting.data_sheet import dyed, other_band, products, read_sheet
from pipeline.fitting.fit_bsdf import fit_bsdf, known_lights
from pipeline.fitting.fitted import DRAFTS, Interval
from pipeline.fitting.predicted import Errors, Predicted, predict
from pipeline.fitting.straight import straight_of
from weaves.errors import BadInput


def _cosine(openness: float, theta: Float64, azimuth: Float64) -> Float64:
    return np.asarray(openness * np.cos(np.radians(theta)))


def roller_blind(openness: float, theta: Float64, azimuth: Float64) -> Float64:
    """Return the form of EnergyPlus for roller blinds, with a cut-off angle that the openness sets."""
    c = math.cos(0.5 * math.pi * openness)
    turn = np.minimum(theta / (90.0 - 25.0 * c), 1.0)
    return np.where(turn < 1.0, openness * np.abs(np.cos(0.5 * math.pi * turn)) ** (0.6 * c**0.3), 0.0)


def woven_shade(openness: float, theta: Float64, azimuth: Float64) -> Float64:
    """Return the form of LBNL WINDOW: round threads of one diameter, evenly spaced in one plane."""
    covered = 1.0 - math.sqrt(openness)
    slope, turn = np.tan(np.radians(theta)), np.radians(azimuth)
    profiles = (np.hypot(1.0, slope * np.cos(turn)), np.hypot(1.0, slope * np.sin(turn)))
    return np.asarray(np.prod([np.maximum(1.0 - covered * secant, 0.0) for secant in profiles], axis=0))


RIVALS: Final = {"cosine": _cosine, "EnergyPlus roller blind": roller_blind, "LBNL WINDOW woven shade": woven_shade}
"""Formulas by what they are called: functions of the openness and of theta and azimuth, (N,)."""


class SheetRow(NamedTuple):
    """A transmittance that was predicted, and the one that the sheet states: NaN if it was kept back."""

    product: str
    band: str
    stated: float
    predicted: Interval


def held_out_rings(
    scattering: Scattering, band: str, advance: Callable[[float], None], drafts: Sequence[str] = tuple(DRAFTS)
) -> dict[str, Errors]:
    """Return the errors of fits on the ring that each was not given, and those of rivals for the same lights.

    Light at normal incidence, one patch, is fitted always. BadInput if less than three other rings are known.
    """
    basis, lights = scattering.basis, known_lights(scattering, band)
    rings = [ring for ring in np.unique(basis.ring[lights]) if ring > 0]
    if len(rings) < 3:
        raise BadInput("fit", "--held-out", f"{len(rings)} rings", "light at three or more angles is needed")
    whole = Predicted.nothing(basis.patches)
    for number, ring in enumerate(rings):
        left_out = lights & (basis.ring == ring)
        part = partial(lambda done, share: advance((done + share) / len(rings)), number)
        fabric = fit_bsdf(scattering, band, "held_out", part, lights & ~left_out, drafts, 0).fabric
        whole = whole.joined(predict(fabric, scattering, band, left_out))
    ours = {"fit, each ring by the others": whole.errors(scattering, band)}
    return ours | rivals(scattering, band, lights & (basis.ring > 0))


def rivals(scattering: Scattering, band: str, lights: Mask) -> dict[str, Errors]:
    """Return the errors of formulas, and those of the means over azimuths, that no model without axes can beat."""
    basis, straight = scattering.basis, straight_of(scattering, band, lights)
    middle = np.mean([basis.bounds[:-1], basis.bounds[1:]], axis=0)
    ring, counts = basis.ring[straight.patches], np.array(basis.counts)
    theta, azimuth = middle[ring], 360.0 * basis.number[straight.patches] / counts[ring]
    openness = float(np.average(straight.share[ring == ring.min()], weights=straight.weight[ring == ring.min()]))
    shares = {name: formula(openness, theta, azimuth) for name, formula in RIVALS.items()}
    shares["means over azimuths, of these very data"] = np.array(
        [np.average(straight.share[ring == own], weights=straight.weight[ring == own]) for own in ring]
    )
    rows = {}
    for name, share in shares.items():
        predicted = Predicted.nothing(basis.patches)
        predicted.straight[straight.patches] = share
        rows[name] = predicted.errors(scattering, band)
    matt = Predicted.nothing(basis.patches)
    matt.reflected[:, :, lights] = np.nanmean(scattering.bands[band][0][:, :, lights], axis=(1, 2))[:, None, None]
    rows["matt, with the reflectance of these very data"] = matt.errors(scattering, band)
    return rows


def predicted_transmittances(path: Path) -> list[SheetRow]:
    """Return the transmittances of the products of a CSV file that white yarns, or the visible band, predict.

    White is the product that reflects most of those that state both bands. BadInput if there is none.
    """
    sheets = [read_sheet(path, product) for product in products(path)]
    complete = [s for s in sheets if s.solar and None not in (s.transmittance, s.solar.transmittance)]
    if not complete:
        raise BadInput(str(path), "", "no product states both transmittances", "white yarns that do are needed")
    white = max(complete, key=lambda sheet: sheet.reflectance)
    rows = []
    for sheet in sheets:
        if sheet is not white and sheet.transmittance is None:
            rows.append(SheetRow(sheet.name, "visible", np.nan, dyed(sheet, white)))
        if sheet is not white and sheet.solar is not None and white.solar is not None:
            stated = np.nan if sheet.solar.transmittance is None else sheet.solar.transmittance
            predicted = other_band(sheet, white) if sheet.transmittance is not None else dyed(sheet.solar, white.solar)
            rows.append(SheetRow(sheet.name, "solar", stated, predicted))
    return rows
