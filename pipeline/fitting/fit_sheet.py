"""A fabric that has the numbers of a data sheet.

Gaps are what goes straight through, (1 - a)(1 - b) with the widths a and b: both are equal unless counts state them.
Colours are those with which the light of all bounces has the reflectances and what is scattered through.
"""

import math
from collections.abc import Callable
from typing import Final

import numpy as np
from scipy.optimize import least_squares

from pipeline.bsdf.klems import BASES
from pipeline.compiled.arrays import Float64
from pipeline.fitting.data_sheet import SHEET_NOISE, DataSheet, SheetBand
from pipeline.fitting.fitted import DRAFTS, Fitted, Interval, cloth
from pipeline.fitting.scattered import Pairs, Scatterer, YarnOptics, with_colours, within_energy
from weaves.count import with_widths
from weaves.errors import BadInput

_OPTICS: Final = YarnOptics((0.4, 0.4), 0.5)
_SPECULAR, _BEND = 0.04, 25.0
_EQUAL = 0.01  # reflectances that differ by less are one
_NARROW = 0.02, 0.5  # by which the openness of counts may differ, and as a part of the stated one


def fit_sheet(sheet: DataSheet, name: str) -> list[Fitted]:
    """Return a fabric of a name in the colours of each band, the visible one first.

    BadInput if counts, openness and thickness contradict.
    """
    optics = f"roughness {_OPTICS.roughness[0]:g}, blend {_OPTICS.blend:g}, specular colour {_SPECULAR:g}"
    assumed = [f"Fibres: {optics}, no twist.", f"Bends: {_BEND:g} degrees. Yarns are opaque to light straight through."]
    widths = _widths(sheet, assumed)
    alike = abs(sheet.reflectance_front - sheet.reflectance_back) <= _EQUAL
    draft = sheet.draft or ("plain" if alike else "twill 3/1")
    if not sheet.draft:
        assumed.append(f"Draft: {draft}. Equal faces or unequal ones determine no more of {len(DRAFTS)}.")
    fabric = cloth(draft, widths, (_BEND, _BEND), (_relief(sheet, widths, assumed),) * 2)
    fabric = fabric.model_copy(update={"name": name, "yarns_per_cm": sheet.sett})
    basis = BASES["LBNL/Klems Quarter"]
    kind, side, out = (index.ravel() for index in np.indices((2, 2, basis.patches)))
    scatterer = Scatterer(fabric, basis, Pairs(kind, side, out, np.zeros_like(kind)))
    unit, size = scatterer.components(_OPTICS), basis.projected_solid_angle

    def shares(colours: Float64) -> Float64:
        """Return reflectances and scattered transmittances of both faces, (2, 2)."""
        return np.asarray((unit @ colours + scatterer.bounced(colours)).reshape(2, 2, -1) @ size)

    gap, fits = (1.0 - widths[0]) * (1.0 - widths[1]), []
    keys = ["openness", *(f"{yarn}.{key}" for key in ("diffuse", "diffuse_transmission") for yarn in ("warp", "weft"))]
    for band in filter(None, (sheet, sheet.solar)):
        colours, errors, left = _colours(band, shares, alike)
        rows = zip(keys, [gap, *colours[2:].tolist()], [SHEET_NOISE, *errors.tolist()], strict=True)
        estimates = {key: Interval(v, max(v - e, 0.0), v + e) for key, v, e in rows}
        coloured = with_colours(fabric, within_energy(fabric, colours), _OPTICS)
        unknown = ["Normal incidence determines no bend, roughness, twist or optical thickness."]
        fits.append(Fitted(coloured, estimates, {"shares": left}, {draft: left / SHEET_NOISE}, assumed, unknown))
    return fits


def _colours(band: SheetBand, shares: Callable[[Float64], Float64], alike: bool) -> tuple[Float64, Float64, float]:
    """Return six colours that have the shares of a band, two errors of the last four, and the error that is left."""
    # Numbers: the diffuse colour of both yarns, or of each, then one for what they transmit.
    order = [0, 0, 1, 1] if alike else [0, 1, 2, 2]
    target = np.array([band.reflectance_front, band.reflectance_back, band.scattered])

    def residuals(numbers: Float64) -> Float64:
        (front, back), through = shares(np.array([_SPECULAR, _SPECULAR, *numbers[order]]))
        return np.asarray(np.array([front, back, through.mean()]) - target)

    best = least_squares(residuals, np.full(order[-1] + 1, 0.3), bounds=(0.0, 1.0), diff_step=0.01, x_scale=0.1)
    errors = 2.0 * SHEET_NOISE * np.sqrt(np.diag(np.linalg.pinv(best.jac.T @ best.jac)))
    return np.array([_SPECULAR, _SPECULAR, *best.x[order]]), errors[order], float(np.abs(best.fun).max())


def _widths(sheet: DataSheet, assumed: list[str]) -> tuple[float, float]:
    """Return the widths of the yarns, by counts or by the openness."""
    stated = sheet.direct_transmittance if sheet.openness is None else sheet.openness
    counts = {key: value for key in ("tex", "ne") if (value := getattr(sheet, key)) is not None}
    if sheet.grams is not None and sheet.sett is not None and not counts:
        counts = {"tex": (10.0 * sheet.grams / sum(sheet.sett),) * 2}
        assumed.append(f"Counts: {counts['tex'][0]:.3g} tex of both yarns, by the grams of the cloth.")
    if not counts or sheet.sett is None:
        assumed.append("Widths: equal, with gaps that let through what goes straight.")
        return (1.0 - math.sqrt(stated),) * 2
    yarns = {yarn: {key: value[k] for key, value in counts.items()} for k, yarn in enumerate(("warp", "weft"))}
    read = with_widths({"sett": sheet.sett, **yarns})
    widths = read["warp"]["width"], read["weft"]["width"]
    assumed.append("Widths: by counts, of fibres of 1.52 g/cm^3 packed to 0.6 of the yarn.")
    gap = (1.0 - widths[0]) * (1.0 - widths[1])
    if stated and abs(gap - stated) > max(_NARROW[0], _NARROW[1] * stated):
        allowed = f"counts and sett give widths {widths[0]:.3g} and {widths[1]:.3g}, which leave {gap:.3g} open"
        raise BadInput(sheet.name, "openness", stated, allowed)
    return widths


def _relief(sheet: DataSheet, widths: tuple[float, float], assumed: list[str]) -> float:
    """Return the relief of both yarns, by the thickness of the cloth where its sett is known."""
    if sheet.thickness is None or sheet.sett is None:
        assumed.append("Reliefs: 1, round yarns.")
        return 1.0
    relief = 0.1 * sheet.thickness / sum(width / count for width, count in zip(widths, sheet.sett, strict=True))
    if not 0.01 <= relief <= 2.0:
        allowed = f"at this sett it makes yarns of a relief of {relief:.3g}; from 0.01 to 2 is possible"
        raise BadInput(sheet.name, "thickness", sheet.thickness, allowed)
    return relief
