"""Predictions of measured cloth by fits that were not given it, beside formulas in use and the laboratories' errors.

The data are shipped (pipeline.fitting.measured). Of the shade each ring of light is predicted by a fit to the others;
of data sheets the transmittance of white yarns by that of charcoal ones, and that of the solar band by the visible one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Final

from pipeline.bsdf.files import read_bsdf
from pipeline.fitting.held_out import held_out_rings, predicted_transmittances
from pipeline.fitting.measured import MEASURED
from pipeline.fitting.predicted import Errors
from pipeline.fitting.scattered import FACE_NOISE, SCATTERED_NOISE
from pipeline.fitting.straight import STRAIGHT_NOISE
from reports.truth.row_records import RowRecords

LABORATORY: Final = "a second measurement"
"""The laboratories' own errors."""

_DRAFTS: Final = ("plain", "twill 2/2")
"""Drafts among which each fit to the shade chooses: one takes two to three minutes for all rings."""

_SHADE, _SHEETS, _BAND = "shade_6216", "fabrics", "visible"
_QUANTITIES: Final = ("light straight through", "reflectance", "BRDF below 65 degrees")


@dataclass(frozen=True)
class Prediction:
    """One quantity of one cloth, as a fit, a formula or another measurement has it."""

    method: str
    """A fit, a formula, or a second measurement."""
    fabric: str
    """The cloth that was measured."""
    quantity: str
    """Which numbers."""
    predicted: Annotated[float, "measured_prediction"] = math.nan
    """Of a data sheet: the number; else NaN."""
    error: Annotated[float, "measured_error"] = math.nan
    """Of a BSDF: relative, as in `Errors`; of a data sheet: difference from the number that it states, or NaN."""
    low: float | None = None
    """Least of the interval of `predicted`."""
    high: float | None = None
    """Largest of it."""
    count: int = 1
    """Of every number; a row is one measurement."""


RECORDS: Final = RowRecords(
    Prediction, setting=("quantity",), method_field="method", once={"low": "low", "high": "high"}
)
"""Predictions as Records."""


def measure(drafts: Sequence[str] = _DRAFTS) -> Iterator[Prediction]:
    """Measure what predicts the rings of the shade, then transmittances of the data sheets."""
    errors = {LABORATORY: Errors(STRAIGHT_NOISE, FACE_NOISE, SCATTERED_NOISE)}
    errors |= held_out_rings(read_bsdf(MEASURED[_SHADE]), _BAND, lambda share: None, drafts)
    for method, row in errors.items():
        for quantity, error in zip(_QUANTITIES, row, strict=True):
            if not math.isnan(error):
                yield Prediction(method, _SHADE, quantity, error=error)
    for sheet in predicted_transmittances(MEASURED[_SHEETS]):
        value, low, high = sheet.predicted
        quantity = f"transmittance, {sheet.band}"
        yield Prediction(
            "fit to the rest of the sheet", sheet.product, quantity, value, value - sheet.stated, low, high
        )
