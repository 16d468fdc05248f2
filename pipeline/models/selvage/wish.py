"""Wished errors and times: the usual one, their text, their ranges."""

import math
from typing import Final

from weaves.errors import BadInput

USUAL_ERROR: Final = 0.02  # wished error of a method that is named without one


def text_of(error: float) -> str:
    """Return the text of a wished error in Records, tables and names of files."""
    return f"error {100 * error:g} %"


def refuse_wishes(name: str, error: float | None, time: float | None) -> None:
    """Refuse both wishes at once, and one that is out of its range, as wishes of the method `name`."""
    if error is not None and time is not None:
        raise BadInput(name, "time", time, "leave out time or error: only one of them can be wished")
    if error is not None and not 0.0 < error < 1.0:
        raise BadInput(name, "error", error, "a relative error above 0 and below 1 is needed, such as .02")
    if time is not None and not 0.0 < time < math.inf:
        raise BadInput(name, "time", time, "seconds a query above 0 are needed, such as 5e-6")
