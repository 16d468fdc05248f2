"""Predictions of measured cloth by fits that were not given it, beside formulas in use and the laboratories' errors.

The data are shipped (pipeline.fitting.measured). Of the shade each ring of light is predicted by a fit to the others;
of data sheets the transmittance of white yarns by that of charcoal ones, and that of the solar band by the visible one.
"""

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

LABORATORY: Final = "a second measurement"  # the laboratories' own errors
_DRAFTS: Final = ("plain", "twill 2/2", "sateen")  # one takes two to three minutes for all rings
_SHADE = "shade_6216"
_QUANTITIES: Final = ("light straight through", "reflectance", "BRDF below 65 degrees")


@dataclass(frozen=True)
class Prediction:
    """One quantity of one cloth, as a fit, a formula or another measurement has it."""

    method: str  # a fit, a formula, or a second measurement
    fabric: str
    quantity: str
    predicted: Annotated[float, "measured_prediction"] = math.nan  # of a data sheet
    error: Annotated[float, "measured_error"] = math.nan
    """Of a BSDF: relative, as in `Errors`; of a data sheet: difference from the number that it states, or NaN."""
    low: float | None = None  # least of the interval of `predicted`
    high: float | None = None
    count: int = 1


RECORDS: Final = RowRecords(
    Prediction, setting=("quantity",), method_field="method", once={"low": "low", "high": "high"}
)


def measure(drafts: Sequence[str] = _DRAFTS) -> Iterator[Prediction]:
    """Measure what predicts the rings of the shade, where fits choose a draft, then transmittances of data sheets."""
    errors = {LABORATORY: Errors(STRAIGHT_NOISE, FACE_NOISE, SCATTERED_NOISE)}
    errors |= held_out_rings(read_bsdf(MEASURED[_SHADE]), "visible", lambda share: None, drafts)
    for method, row in errors.items():
        for quantity, error in zip(_QUANTITIES, row, strict=True):
            if not math.isnan(error):
                yield Prediction(method, _SHADE, quantity, error=error)
    for sheet in predicted_transmittances(MEASURED["fabrics"]):
        value, low, high = sheet.predicted
        subject = "fit to the rest of the sheet", sheet.product, f"transmittance, {sheet.band}"
        yield Prediction(*subject, value, value - sheet.stated, low, high)
