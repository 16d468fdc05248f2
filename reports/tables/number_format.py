"""Numbers and names as the page and the terminal print them; what was not measured is a dash."""

import math
import re
from collections.abc import Callable, Sequence
from typing import Final

from reports.catalogue import metric_row
from reports.measure.memory import UNSURE

NONE = "–"
NO_BREAK: Final = "\N{NO-BREAK SPACE}"
IN_THE_NOISE: Final = "in the noise"

NAMES: Final = {
    "neumip": "NeuMIP",
    "point_sampled": "points",
    "r2_points": "R2 points",
    "unified_btf": "unified BTF",
    "btf_autoencoder": "BTF autoencoder",
    "curved_grazing": "curved, grazing",
}
"""Display names of methods, where they are not the name with spaces."""


def plain(name: str) -> str:
    """Return a fabric's name as words: ``wool gabardine``, ``twill 4/4``."""
    return re.sub(r"(?<=\d)_(?=\d)", "/", name).replace("_", " ")


def display(method: str, setting: str = "") -> str:
    """Return the display name of a method, with its setting."""
    name = NAMES.get(method, method.replace("_", " "))
    return f"{name}, {setting.replace(' ', NO_BREAK)}" if setting else name


def scientific(value: float | None, digits: int = 2) -> str:
    """Return ``2.62e-3``."""
    if missing(value):
        return NONE
    mantissa, _, exponent = f"{value:.{digits}e}".partition("e")
    return f"{mantissa}e{int(exponent)}".replace("-", "−")


def beyond_noise(value: float, worded: Callable[[float], str]) -> str:
    """Return an error in words, or that nothing of it is left after the noise of the truth was subtracted."""
    return IN_THE_NOISE if value <= 0 else worded(value)


def signed(value: float) -> str:
    """Return a number with its sign; 0 has none."""
    return NONE if missing(value) else ("+" if value > 0 else "") + scientific(value)


def times(value: float) -> str:
    """Return ``4.1×``."""
    return NONE if missing(value) else f"{value:.2g}×" if value < 10 else f"{value:,.0f}×"


def significant(value: float) -> str:
    """Return a number with three digits or all those before the point: ``1,696``, ``12.3``, ``.0456``."""
    if missing(value):
        return NONE
    digits = max(0, 2 - math.floor(math.log10(abs(value)))) if value else 0
    return re.sub(r"^0(?=\.)", "", f"{value:,.{digits}f}")


def percent(value: float, digits: int = 1) -> str:
    """Return ``1.5 %``."""
    return NONE if missing(value) else f"{100 * value:.{digits}f} %".replace("-", "−")


def fixed_to(value: float, digits: int) -> str:
    """Return ``1,696``, or ``31.4``."""
    return NONE if missing(value) else f"{value:,.{digits}f}"


def fixed(value: float) -> str:
    """Return ``.123``."""
    return NONE if missing(value) else f"{value:.3f}".removeprefix("0")


def size(value: float) -> str:
    """Return bytes in the unit that suits them."""
    if missing(value):
        return NONE
    return f"{value:,.0f} B" if value < 1e3 else f"{value / 1e3:,.1f} kB" if value < 1e6 else f"{value / 1e6:,.2f} MB"


def seconds(value: float) -> str:
    """Return a time in the unit that suits it: ``20.0 µs``."""
    if missing(value):
        return NONE
    factor, unit = (1e6, "µs") if value < 1e-3 else (1e3, "ms") if value < 1 else (1.0, "s")
    return f"{significant(factor * value)} {unit}"


def span(worded: Callable[[float], str], low: float, high: float) -> str:
    """Return both ends of a range in words: ``[1.2 … 3.4 %]``, ``[1.97 … 2.73]e−2``; empty where there is none."""
    if missing(low) or missing(high):
        return ""
    ends = [worded(end).replace(IN_THE_NOISE, "0") for end in (low, high)]
    if "e" in ends[1]:
        exponent = int(f"{max(low, high, key=abs):e}".partition("e")[2])
        return f"[{' … '.join(f'{end / 10.0**exponent:.2f}' for end in (low, high))}]e{exponent}".replace("-", "−")
    unit = re.search(r"[^\d.,−+]*$", ends[1])
    return f"[{ends[0].removesuffix(unit[0] if unit else '')} … {ends[1]}]"


def listed(words: Sequence[str]) -> str:
    """Return words as ``a, b and c``; at least one."""
    *most, last = words
    return f"{', '.join(most)} and {last}" if most else last


def missing(value: float | None) -> bool:
    """Return whether there is no finite number."""
    return value is None or not math.isfinite(value)


FORMATS: Final[dict[str, Callable[[float], str]]] = {
    "scientific": scientific,
    "signed": signed,
    "percent": percent,
    "fine percent": lambda value: percent(value, 2),
    "whole percent": lambda value: percent(value, 0),
    "three decimals": fixed,
    "two decimals": lambda value: fixed_to(value, 2),
    "one decimal": lambda value: fixed_to(value, 1),
    "significant": significant,
    "grouped": lambda value: fixed_to(value, 0),
    "bytes": size,
    "seconds": seconds,
    "times": times,
    "share": lambda value: NONE if missing(value) else "0" if value == 0 else f"{value:.1e}",
    "outwards": lambda value: NONE if missing(value) else f"{value:+.4f}".replace("-", "−"),
    "memory": lambda value: f"below {size(UNSURE)}" if value < UNSURE else size(value),
}
"""Formats of the catalogue, and of columns of `tables.toml`."""


def shown(metric: str, value: float) -> str:
    """Return the value of a metric in its format (`reports.catalogue`)."""
    return FORMATS[metric_row(metric).format](value)
