"""Fabrics from draft files: structure, colours and size are the file's, the optics of the yarns another fabric's.

A draft file says nothing of fibres, twist, bend or roughness. Everything that is assumed is a sentence.
"""

from collections import Counter
from collections.abc import Mapping
from itertools import groupby
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from weaves.colour import linear_rgb
from weaves.colour_order import MOST_COLOURS
from weaves.draft import LARGEST_REPEAT, Bools, Draft, numbered, smallest_period
from weaves.draft_files.read import DraftFile, DraftThreads
from weaves.errors import BadInput, one_line
from weaves.fabric import Fabric
from weaves.validation import validated
from weaves.yarn import NARROWEST_YARN

LONG_REPEAT: Final = 128  # threads of a longer repeat are searched for a shorter one, of which the last is not whole
MOST_SOURCE: Final = 2000  # most letters of a fabric's `source`


class Imported(NamedTuple):
    """A fabric from a draft file, with what was read and assumed."""

    fabric: Fabric
    read: tuple[str, ...]  # sentences on what the file states
    assumed: tuple[str, ...]  # sentences on what it does not state, or what could not be used


def fabric_of(draft: DraftFile, like: Fabric, name: str, where: str, given: dict[str, dict[str, float]]) -> Imported:
    """Return the fabric of a draft file.

    The yarns of the fabric `like` give what the file, which messages call `where`, does not state. The numbers `given`
    for the yarns ``"warp"`` and ``"weft"`` replace those of `like` and of the file.

    BadInput if the smallest repeat is larger than `LARGEST_REPEAT`, a yarn never changes side, more than `MOST_COLOURS`
    colours are used, or a given number is not allowed.
    """
    read: list[str] = []
    assumed = list(draft.remarks)
    matrix = _repeat(draft.warp_over, where, read, assumed)
    _refuse_loose(matrix, where)
    woven = Draft(matrix)
    if not woven.hangs_together():
        assumed.append("Some yarns lie loose on others, as in a double cloth: all are treated as one layer.")
    yarns = {}
    for axis, threads in (("warp", draft.ends), ("weft", draft.picks)):
        own = _width(axis, threads, like, given[axis], read, assumed)
        yarns[axis] = getattr(like, axis).model_dump(exclude={"width", "diffuse"}) | own | given[axis]
    colours = _colours(draft, like, yarns, where, read, assumed)
    size = None
    if draft.ends.per_cm and draft.picks.per_cm:
        size = [float(f"{per_cm:.4g}") for per_cm in (draft.ends.per_cm, draft.picks.per_cm)]  # files have 3 decimals
        read.append(f"Size: {size[0]:g} ends and {size[1]:g} picks per cm.")
    else:
        assumed.append("The file does not state the size of the cloth: the fabric has no yarns_per_cm.")
    assumed.append("The colours are read as sRGB and taken for the diffuse colours of the yarns.")
    assumed.append(_optics(like, given))
    about = f"Draft {draft.title!r}" + (f", written by {draft.program}" if draft.program else "")
    source = f"{about}, from {Path(where).name}. " + " ".join((*read, *assumed))
    table: dict[str, Any] = yarns | {
        "name": name,
        "source": one_line(source, MOST_SOURCE),
        "optical_thickness": like.optical_thickness,
        "yarns_per_cm": size,
        "draft": {"family": "matrix", "rows": woven.rows()},
        "colours": colours,
    }
    return Imported(validated(Fabric, table, where), tuple(read), tuple(assumed))


def _repeat(over: Bools, where: str, read: list[str], assumed: list[str]) -> Bools:
    picks, ends = over.shape
    periods = []
    for axis, section, threads in ((0, "[TREADLING]", "picks"), (1, "[THREADING]", "ends")):
        lines = np.ascontiguousarray(np.moveaxis(over, axis, 0))
        numbers = np.array(numbered([line.tobytes() for line in lines])[0])
        period = smallest_period(numbers)
        if period > LONG_REPEAT:  # a last repeat that is not whole, as at a selvedge
            shifts = range(1, min(LARGEST_REPEAT, len(numbers) // 2) + 1)
            period = next((p for p in shifts if np.array_equal(numbers[p:], numbers[:-p])), period)
            if period > LARGEST_REPEAT:
                allowed = f"at most {LARGEST_REPEAT} are allowed; choose a part by --{threads} 1-{LARGEST_REPEAT}"
                raise BadInput(where, "", f"{section} repeats after {period} {threads}", allowed)
            if rest := len(numbers) % period:
                assumed.append(f"The last {rest} {threads} do not fill a repeat and are left out.")
        periods.append(period)
    read.append(f"Structure: {ends} ends and {picks} picks; it repeats after {periods[1]} ends and {periods[0]} picks.")
    return over[: periods[0], : periods[1]]


def _refuse_loose(matrix: Bools, where: str) -> None:
    for section, thread, lines in (("[THREADING]", "end", matrix.T), ("[TREADLING] or [LIFTPLAN]", "pick", matrix)):
        for number, line in enumerate(lines, 1):
            if line.all() or not line.any():
                sentence = f"{thread} {number} of {section} never changes side"
                raise BadInput(where, "", sentence, "it is not woven in, so this is not a cloth")


def _width(
    axis: str, threads: DraftThreads, like: Fabric, given: Mapping[str, float], read: list[str], assumed: list[str]
) -> dict[str, float]:
    """Return the width of a yarn as the file states it, else that of `like`."""
    title, yarn = axis.capitalize(), getattr(like, axis)
    if "width" in given:
        return {}
    if threads.width is None:
        assumed.append(f"{title}: the file states no thickness; width {yarn.width:g} is that of {like.name}.")
        return {"width": yarn.width}
    stated = round(threads.width, 4)
    width = min(max(stated, NARROWEST_YARN), 1.0)
    if width != stated:
        ratio = f"the thickness is {stated:g} of the spacing, outside of {NARROWEST_YARN:g} to 1"
        assumed.append(f"{title}: {ratio}; width {width:g} is taken.")
    else:
        read.append(f"{title}: width {width:g} of the spacing.")
    return {"width": width}


def _colours(
    draft: DraftFile, like: Fabric, yarns: dict[str, Any], where: str, read: list[str], assumed: list[str]
) -> dict[str, Any] | None:
    """Give each yarn its most frequent colour, and return the colour order; None if each axis has one colour."""
    axes = (("warp", "ends", draft.ends.colours, like.warp), ("weft", "picks", draft.picks.colours, like.weft))
    used = numbered([colour for _, _, colours, _ in axes for colour in colours])[1]
    if len(used) > MOST_COLOURS:
        raise BadInput(where, "", f"the threads have {len(used)} colours of [COLOR TABLE]", f"at most {MOST_COLOURS}")
    names = {colour: f"colour_{number}" for number, colour in enumerate(used, 1)}
    palette: dict[str, dict[str, Any]] = {}
    orders: dict[str, list[list[Any]]] = {}
    most = {axis: np.array(yarn.most_diffuse(like.optical_thickness)) for axis, _, _, yarn in axes}
    brightest = {axis: np.max([linear_rgb(c) for c in set(colours)], axis=0) for axis, _, colours, _ in axes}
    factor = min(1.0, *(float((most[a] / np.maximum(brightest[a], 1e-9)).min()) for a in most))
    if factor < 1.0:
        scaled = f"all are taken times {factor:.3f}, as linear RGB"
        assumed.append(f"Colours as bright as the file's would send back more light than arrives: {scaled}.")
    dimmed = False
    for axis, threads, colours, yarn in axes:
        yarns[axis]["diffuse"] = _scaled(Counter(colours).most_common(1)[0][0], factor)
        left = most[axis] - factor * brightest[axis]
        if (yarn.diffuse_transmission_rgb > left).any():
            least = np.maximum(left - 1e-6, 0.0)
            yarns[axis]["diffuse_transmission"] = np.minimum(yarn.diffuse_transmission_rgb, least).round(6).tolist()
            dimmed = True
        if len(set(colours)) == 1:
            read.append(f"Colours: all {threads} are {colours[0]}.")
            continue
        order = colours[: smallest_period(np.array(colours))]
        palette |= {names[colour]: {"diffuse": _scaled(colour, factor)} for colour in order}
        orders[threads] = [[names[colour], len(list(run))] for colour, run in groupby(order)]
        read.append(f"Colours: the {threads} have {len(set(order))}, whose order repeats after {len(order)} {threads}.")
    if dimmed:
        assumed.append("Bright colours send back nearly all light: the light through the yarns is reduced.")
    return {"palette": palette} | orders if orders else None


def _scaled(colour: str, factor: float) -> str | list[float]:
    """Return an sRGB colour times a factor, linear RGB rounded down; itself if the factor is 1."""
    return colour if factor == 1.0 else (np.floor(1e6 * factor * np.array(linear_rgb(colour))) / 1e6).tolist()


def _optics(like: Fabric, given: Mapping[str, Mapping[str, float]]) -> str:
    parts = []
    for key, unit in (("bend", "°"), ("twist", "°"), ("roughness", "")):
        values = [given[axis].get(key, getattr(yarn, key)) for axis, yarn in (("warp", like.warp), ("weft", like.weft))]
        parts.append(f"{key} {values[0]:g}{unit} and {values[1]:g}{unit}")
    options = [f"{axis}.{key}" for axis, numbers in given.items() for key in numbers]
    own = f" Your own: {', '.join(options)}." if options else ""
    others = "its relief, blend, specular colour, light through the yarns and optical thickness"
    return (
        f"A draft does not state the optics of yarns. Those of {like.name} are taken, for warp and weft: "
        f"{', '.join(parts)}; also {others}.{own}"
    )
