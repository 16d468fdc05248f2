"""The sections of a WIF text, checked one by one, so that each error names its section.

WIF (Weaving Information File, version 1.1) is a text of sections and keys. The reader of dtx-to-wif never returns on
some texts and raises bare errors on others, so it is not used.
"""

import warnings
from collections.abc import Mapping
from configparser import ConfigParser, ParsingError
from typing import Annotated, Any, Final

from dtx_to_wif import PatternData, WarpWeftData
from pydantic import BaseModel, BeforeValidator, Field, ValidationError

from weaves.colour_order import MOST_THREADS
from weaves.errors import BadInput
from weaves.reading import MIB

MOST_WIF_BYTES: Final = 4 * MIB  # most bytes of a draft file

MOST_USED: Final = MIB
"""Most letters of the sections that are read; others, such as pictures of single programs, are left out before."""

MOST_LINE_LETTERS: Final = 8192  # most letters of a line
MOST_ENTRIES: Final = 16 * MOST_THREADS  # most lines of the sections that are read

Thread = Annotated[int, Field(ge=1, le=MOST_THREADS)]
Count = Annotated[int, Field(ge=0, le=MOST_THREADS)]
Length = Annotated[float, Field(ge=0, le=1e6, allow_inf_nan=False)]
Level = Annotated[int, Field(ge=0, le=65535)]
Index = Annotated[int, Field(ge=0, le=65536)]


def _filled(section: Any) -> Any:
    """Leave out keys without a value, which have the default."""
    return {key: text for key, text in section.items() if text and text.strip()}


def _parts(text: Any) -> Any:
    """Split at commas; pydantic reports what is no text."""
    return [part.strip() for part in text.split(",")] if isinstance(text, str) else text


def _filled_parts(text: Any) -> Any:
    """Split at commas and leave out empty items, as in ``2=,1``."""
    parts = _parts(text)
    if not isinstance(text, str) or all(parts):
        return parts
    warnings.warn("Some entries have empty items, as in 2=,1: they are left out.", stacklevel=1)
    return [part for part in parts if part]


Numbers = Annotated[set[Count], BeforeValidator(_filled_parts)]
Sets = Annotated[dict[Thread, Numbers], BeforeValidator(_filled)]
Colours = Annotated[dict[Thread, Count], BeforeValidator(_filled)]
Lengths = Annotated[dict[Thread, Length], BeforeValidator(_filled)]
Levels = Annotated[tuple[Level, Level, Level], BeforeValidator(_parts)]
Table = Annotated[dict[Index, Levels], BeforeValidator(_filled)]


class _Text(BaseModel):
    title: str | None = None


class _Program(BaseModel):
    source_program: Annotated[str | None, Field(alias="source program")] = None
    source_version: Annotated[str | None, Field(alias="source version")] = None


class _Weaving(BaseModel):
    shafts: Annotated[int | None, Field(ge=1, le=MOST_THREADS)] = None
    treadles: Count | None = None
    rising_shed: Annotated[bool | None, Field(alias="rising shed")] = None


class _Yarns(BaseModel):
    threads: Annotated[int | None, Field(ge=1, le=MOST_THREADS)] = None
    color: Annotated[tuple[Index, ...] | None, BeforeValidator(_parts)] = None
    spacing: Length | None = None
    thickness: Length | None = None
    units: str | None = None


class _Palette(BaseModel):
    range: Annotated[tuple[Level, Level] | None, BeforeValidator(_parts)] = None


Filled = BeforeValidator(_filled)


class _Wif(BaseModel):
    """The sections that are read; their names in lower case with _."""

    wif: Annotated[_Program, Filled] = _Program()
    text: Annotated[_Text, Filled] = _Text()
    weaving: Annotated[_Weaving, Filled] = _Weaving()
    warp: Annotated[_Yarns, Filled] = _Yarns()
    weft: Annotated[_Yarns, Filled] = _Yarns()
    color_palette: Annotated[_Palette, Filled] = _Palette()
    color_table: Table = {}
    threading: Sets = {}
    tieup: Annotated[dict[Count, Numbers], BeforeValidator(_filled)] = {}
    treadling: Sets = {}
    liftplan: Sets = {}
    warp_colors: Colours = {}
    weft_colors: Colours = {}
    warp_spacing: Lengths = {}
    weft_spacing: Lengths = {}
    warp_thickness: Lengths = {}
    weft_thickness: Lengths = {}


def _section_name(field: str) -> str:
    return f"[{field.upper().replace('_', ' ')}]"


def wif_pattern(text: str, where: str) -> PatternData:
    """Return what a WIF text says, with a UserWarning for what cannot be used; `where` names the file in messages.

    BadInput if there is no section [WIF], one is missing, damaged or contradicts another, or a limit is exceeded.
    """
    try:
        wif = _Wif.model_validate(_sections(text, where))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        section, *keys = first["loc"]
        key = " ".join([_section_name(str(section)), *(str(key) for key in keys[:1])])
        raise BadInput(where, key, first["input"], first["msg"]) from error
    _refuse_missing(wif, where)
    _count_from_one(wif)
    _complete_colours(wif, where)
    yarns: dict[str, Any] = {axis: _yarns_of(wif, axis, where) for axis in ("warp", "weft")}
    # The reader takes the number of tied treadles for the last of them.
    wif.weaving.treadles = max([wif.weaving.treadles or 0, *wif.tieup])
    if not wif.liftplan:
        used = {treadle for treadles in wif.treadling.values() for treadle in treadles if treadle}
        if untied := sorted(used - {treadle for treadle, shafts in wif.tieup.items() if any(shafts)}):
            numbers = ", ".join(map(str, untied))
            warnings.warn(f"[TIEUP] ties nothing to treadle {numbers} of [TREADLING]: it lifts nothing.", stacklevel=1)
        wif.weaving.treadles = max([wif.weaving.treadles, *used])
    # What is left of the sections has the names of dtx-to-wif.
    names = [name for name in _Wif.model_fields if name.startswith(("warp_", "weft_"))]
    read = yarns | {name: getattr(wif, name) for name in ("threading", "tieup", "treadling", "liftplan", *names)}
    return PatternData(
        name=wif.text.title or where,
        color_table=wif.color_table,
        color_range=wif.color_palette.range,
        is_rising_shed=wif.weaving.rising_shed is not False,
        source_program=wif.wif.source_program or "?",
        source_version=wif.wif.source_version or "?",
        num_shafts=wif.weaving.shafts or 0,
        num_treadles=wif.weaving.treadles,
        **read,
    )


def _sections(text: str, where: str) -> dict[str, Mapping[str, str | None]]:
    """Parse the sections that are read: those of others may have anything in them."""
    lines = text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n").split("\n")
    kept: list[str] = []
    known = {name.replace("_", " ") for name in _Wif.model_fields} | set(_Wif.model_fields)
    inside, begun = False, False
    for raw in lines:
        # An indented line would continue the one before, and the parser's time is cubic in the length of a gap.
        line = " ".join(raw.split())
        if line.startswith("["):
            name = line[1:].partition("]")[0].strip().lower()
            begun = begun or name == "wif"
            inside = begun and name in known
            kept += [f"[{name.replace(' ', '_')}]"] * inside
        elif inside and line:
            if len(line) > MOST_LINE_LETTERS:
                long = f"{_section_name(name)} has a line of {len(line):,} letters"
                raise BadInput(where, "", long, f"at most {MOST_LINE_LETTERS:,}")
            kept.append(line)
    if not begun:
        raise BadInput(where, "", "has no section [WIF]", "a draft in the Weaving Information File format is needed")
    if len(kept) > MOST_ENTRIES or sum(map(len, kept)) > MOST_USED:
        raise BadInput(where, "", f"has {len(kept):,} lines", f"at most {MOST_ENTRIES:,} with {MOST_USED:,} letters")
    parser = ConfigParser(interpolation=None, allow_no_value=True, strict=False, inline_comment_prefixes=(";",))
    try:
        parser.read_string("\n".join(kept))
    except ParsingError as error:
        number, line = error.errors[0][0], kept[error.errors[0][0] - 1]
        section = next(entry for entry in reversed(kept[:number]) if entry.startswith("["))
        wrong = f"{_section_name(section[1:-1])} has the line {line}"
        raise BadInput(where, "", wrong, "a line is KEY=VALUE") from error
    return {name: dict(parser[name]) for name in parser.sections()}


def _refuse_missing(wif: _Wif, where: str) -> None:
    """Refuse a draft without a threading, colours, or what lifts the shafts."""
    if not any(any(shafts) for shafts in wif.threading.values()):
        raise BadInput(where, "", "[THREADING] is missing or empty", "the shaft of each end is needed")
    if not any(any(shafts) for shafts in wif.liftplan.values()):
        for name, sets in (("[TREADLING]", wif.treadling), ("[TIEUP]", wif.tieup)):
            if not any(any(numbers) for numbers in sets.values()):
                needed = "[TIEUP] and [TREADLING], or [LIFTPLAN], are needed"
                raise BadInput(where, "", f"{name} is missing or empty, and so is [LIFTPLAN]", needed)


def _count_from_one(wif: _Wif) -> None:
    """Count treadles and shafts from 1: some programs count them from 0, where WIF means none."""
    lifts = "liftplan" if wif.liftplan else "tieup"
    if lifts == "tieup" and 0 in wif.tieup:
        wif.tieup = {treadle + 1: shafts for treadle, shafts in wif.tieup.items()}
        wif.treadling = {pick: {treadle + 1 for treadle in treadles} for pick, treadles in wif.treadling.items()}
        warnings.warn("[TIEUP] counts treadles from 0; they are counted from 1 here.", stacklevel=1)
    used = [{shaft for shafts in sets.values() for shaft in shafts} for sets in (wif.threading, getattr(wif, lifts))]
    # With 0 for "none", the last of the stated shafts is used as well.
    if 0 in used[0] & used[1] and wif.weaving.shafts == max(used[0] | used[1]) + 1:
        for name in ("threading", lifts):
            setattr(wif, name, {key: {shaft + 1 for shaft in shafts} for key, shafts in getattr(wif, name).items()})
        warnings.warn("[THREADING] counts shafts from 0; they are counted from 1 here.", stacklevel=1)


def _complete_colours(wif: _Wif, where: str) -> None:
    """Give colours to a draft without any, and a range to a palette without one; BadInput if they do not agree."""
    if not wif.color_table:
        wif.color_table, wif.color_palette.range = {1: (32, 32, 32), 2: (255, 255, 255)}, (0, 255)
        wif.warp_colors, wif.weft_colors, wif.warp.color, wif.weft.color = {}, {}, (1,), (2,)
        warnings.warn("[COLOR TABLE] is missing or empty: the ends are dark, the picks white.", stacklevel=1)
    if wif.color_palette.range is None:
        brightest = max(level for levels in wif.color_table.values() for level in levels)
        wif.color_palette.range = 0, next(most for most in (255, 999, 65535) if brightest <= most)
        stated = f"0 to {wif.color_palette.range[1]} is taken"
        warnings.warn(f"[COLOR PALETTE] states no Range: {stated}.", stacklevel=1)
    least, most = wif.color_palette.range
    if least >= most:
        raise BadInput(where, "[COLOR PALETTE] Range", (least, most), "the first number must be less than the second")
    for index, levels in wif.color_table.items():
        if not all(least <= level <= most for level in levels):
            allowed = f"numbers from {least} to {most}, the range of [COLOR PALETTE], are needed"
            raise BadInput(where, f"[COLOR TABLE] {index}", levels, allowed)


def _yarns_of(wif: _Wif, axis: str, where: str) -> WarpWeftData:
    """Return the numbers of an axis, its colours checked, with the defaults without which lengths are dropped."""
    yarns: _Yarns = getattr(wif, axis)
    colours: dict[int, int] = getattr(wif, f"{axis}_colors")
    known = f"[COLOR TABLE] has {len(wif.color_table)} colours, {min(wif.color_table)} to {max(wif.color_table)}"
    for thread, colour in colours.items():
        if colour not in wif.color_table:
            raise BadInput(where, f"{_section_name(f'{axis}_colors')} {thread}", colour, known)
    sets = wif.threading if axis == "warp" else wif.liftplan or wif.treadling
    threads = max([yarns.threads or 0, *sets])
    section, default = _section_name(axis), yarns.color[0] if yarns.color else -1
    if yarns.threads and max(sets) > yarns.threads:
        stated = f"{yarns.threads} threads, the draft has {max(sets)}"
        warnings.warn(f"{section} states {stated}: all are read.", stacklevel=1)
    if default not in wif.color_table:
        # Most programs state no default where each thread has a colour of its own.
        without = sorted(set(range(1, threads + 1)) - set(colours))
        if yarns.color and (not colours or set(colours) != set(range(1, len(colours) + 1))):
            raise BadInput(where, "", f"{section} has Color = {default}", known)
        stated = f"Color = {default}, which is not in [COLOR TABLE]" if yarns.color else "no Color"
        default = colours[min(colours)] if colours else min(wif.color_table)
        if without:
            threads_without = f"{len(without)} thread{'s' if len(without) > 1 else ''} from {without[0]} on"
            warnings.warn(f"{section} states {stated}: {threads_without} take the first, {default}.", stacklevel=1)
    for key in ("spacing", "thickness"):
        lengths: dict[int, float] = getattr(wif, f"{axis}_{key}")
        if lengths and getattr(yarns, key) is None:
            if len(lengths) >= threads:
                setattr(yarns, key, next(iter(lengths.values())))
            else:
                single = _section_name(f"{axis}_{key}")
                warnings.warn(f"{section} states no {key.title()}: {single} is not used.", stacklevel=1)
                lengths.clear()
    return WarpWeftData(threads, default, None, yarns.spacing, yarns.thickness, yarns.units)
