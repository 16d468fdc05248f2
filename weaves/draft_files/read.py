"""Draft files of weaving programs, read by dtx-to-wif: .wif, .wifw, .dtx, .wpo and .twa.

Every file is bounded and checked before and after, because the library hangs on some files, raises bare errors on
others, and accepts numbers that are none. Each refusal is one `BadInput`.
"""

import io
import math
import warnings
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final, NamedTuple, TypeVar

import numpy as np
from dtx_to_wif import PatternData, dtx_reader, make_liftplan, read_dtx, read_wpo
from dtx_to_wif.twa_reader import WIF_FILE_NAME

from weaves.colour_order import MOST_THREADS
from weaves.draft import Bools
from weaves.draft_files.wif_sections import MOST_USED, MOST_WIF_BYTES, wif_pattern
from weaves.errors import BadInput, one_line
from weaves.reading import read_bytes

Result = TypeVar("Result")

CENTIMETRES: Final = {"decipoints": 2.54 / 720, "inches": 2.54, "centimeters": 1.0}  # units of lengths in draft files

_EPI, _PPI = 9, 10  # bytes of a WeavePoint file: ends and picks per inch


class DraftThreads(NamedTuple):
    """The ends, or the picks, of a draft file."""

    colours: tuple[str, ...]  # sRGB colour of each thread, ``"#rrggbb"``, the first thread first
    width: float | None  # mean thickness over mean spacing; None if the file does not state both
    per_cm: float | None  # threads per centimetre; None if the file states no spacing or no known unit


class DraftFile(NamedTuple):
    """A draft as its file has it."""

    title: str  # as the file or its name says
    program: str  # program that wrote it, with its version
    warp_over: Bools  # true where the warp is on top, (picks, ends), the first pick and the first end first
    ends: DraftThreads
    picks: DraftThreads
    remarks: tuple[str, ...]  # sentences on what could not be used


def cut_out(draft: DraftFile, ends: tuple[int, int] | None, picks: tuple[int, int] | None) -> DraftFile:
    """Return a part of a draft: its first and last end, its first and last pick, counted from 1; None: all of them."""
    parts = []
    for threads, limits in ((draft.ends, ends), (draft.picks, picks)):
        first, last = limits or (1, len(threads.colours))
        parts.append((slice(first - 1, last), threads._replace(colours=threads.colours[first - 1 : last])))
    (over_ends, own_ends), (over_picks, own_picks) = parts
    return draft._replace(warp_over=draft.warp_over[over_picks, over_ends], ends=own_ends, picks=own_picks)


def read_draft(path: Path) -> DraftFile:
    """Read a draft file, whose suffix says the format; BadInput if that is unknown, or it is too large or no draft."""
    where = str(path)
    if (reader := READERS.get(path.suffix.lower())) is None:
        raise BadInput(where, "", "no known draft file", f"its name must end in {', '.join(READERS)}")
    try:
        content = read_bytes(path, MOST_WIF_BYTES, "a draft file")
    except FileNotFoundError as error:
        raise BadInput(where, "", "no such file", "the path of a draft file is needed") from error
    with warnings.catch_warnings(record=True) as noted:
        warnings.simplefilter("always")
        pattern = reader(content, where)
    remarks = list(dict.fromkeys(one_line(f"{note.message}", 160) for note in noted))
    return _draft_file(pattern, path, remarks)


def _read_wif(content: bytes, where: str) -> PatternData:
    text = decoded(content)
    return _called(lambda: wif_pattern(text, where), where, "a WIF draft")


def _read_twa(content: bytes, where: str) -> PatternData:
    """Read the WIF text inside a file of TempoWeave, which is a ZIP archive."""

    def unpacked() -> bytes:
        with zipfile.ZipFile(io.BytesIO(content)) as archive, archive.open(WIF_FILE_NAME) as file:
            return file.read(MOST_WIF_BYTES + 1)

    text = _called(unpacked, where, "a TempoWeave draft")
    if len(text) > MOST_WIF_BYTES:
        large = f"{WIF_FILE_NAME} has more than {MOST_WIF_BYTES:,} bytes"
        raise BadInput(where, "", large, "at most so many are allowed")
    return _read_wif(text, where)


def _read_dtx(content: bytes, where: str) -> PatternData:
    text = decoded(content).lstrip("\ufeff \r\n\t")
    if not text.startswith("@@"):
        raise BadInput(where, "", "has no section @@StartDTX", "a draft of FiberWorks is needed")
    if len(text) > MOST_USED:
        raise BadInput(where, "", f"has {len(text):,} letters", f"at most {MOST_USED:,} are allowed")
    sections = _called(lambda: dtx_reader.read_dtx_sections(io.StringIO(text)), where, "a FiberWorks draft")
    for name, process in dtx_reader.section_dispatcher.items():
        if name in sections:
            _called(lambda name=name, process=process: process(sections[name]), where, f"section @@{name}")  # type: ignore[misc]
    for name in ("threading", "color_table"):
        if not (name in sections and sections[name].data):
            raise BadInput(where, "", f"section @@{name} is missing or empty", "it is needed")
    pattern = _called(lambda: read_dtx(io.StringIO(text), where), where, "a FiberWorks draft")
    for axis, threads in (("warp", "ends"), ("weft", "picks")):
        if f"{axis}_spacing" not in sections:
            default = f"FiberWorks' default, {dtx_reader.DefaultFiberSpacing:g} cm, is taken"
            warnings.warn(f"The file states no spacing of its {threads}: {default}.", stacklevel=1)
    return pattern


def _read_wpo(content: bytes, where: str) -> PatternData:
    """Read a file of WeavePoint; old versions state no yarns per inch, by which the reader would divide."""
    unstated = [place for place in (_EPI, _PPI) if content[place : place + 1] == b"\0"]
    readable = bytearray(content)
    for place in unstated:
        readable[place] = 1
    pattern = _called(lambda: read_wpo(io.BytesIO(readable), Path(where).stem), where, "a WeavePoint draft")
    lifts = pattern.liftplan or pattern.treadling
    for place, yarns, threads in (
        (_EPI, pattern.warp, [*pattern.threading, *pattern.warp_colors]),
        (_PPI, pattern.weft, [*lifts, *pattern.weft_colors]),
    ):
        yarns.threads = max(threads)  # the file's number is the most that its window can show
        if place in unstated:
            yarns.spacing = None
    return pattern


READERS: Final[Mapping[str, Callable[[bytes, str], PatternData]]] = {
    ".wif": _read_wif,
    ".wifw": _read_wif,
    ".dtx": _read_dtx,
    ".wpo": _read_wpo,
    ".twa": _read_twa,
}
"""Formats by the suffix of their files."""


def decoded(content: bytes) -> str:
    """Return a text of UTF-8, else of Windows-1252, which most old programs write."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")


def _called(call: Callable[[], Result], where: str, kind: str) -> Result:
    """Call the library; whatever it raises is a damaged file."""
    try:
        return call()
    except BadInput:
        raise
    except Exception as error:
        missing = f"the entry {one_line(error, 60)} is missing" if isinstance(error, LookupError) else ""
        reason = missing or one_line(error, 120) or type(error).__name__
        raise BadInput(where, "", f"cannot be read as {kind}", reason) from error


def _draft_file(pattern: PatternData, path: Path, remarks: list[str]) -> DraftFile:
    where = str(path)
    lifts = pattern.liftplan or pattern.treadling
    ends, picks = max([pattern.warp.threads, *pattern.threading]), max([pattern.weft.threads, *lifts])
    for section, count in (("[WARP]", ends), ("[WEFT]", picks)):
        if not 1 <= count <= MOST_THREADS:
            raise BadInput(where, f"{section} Threads", count, f"a number from 1 to {MOST_THREADS} is needed")
    if not pattern.liftplan:  # the reader leaves out treadles that lift nothing, and fails on them then
        pattern.tieup |= {used: set() for pressed in lifts.values() for used in pressed - pattern.tieup.keys()}
    least, most = pattern.color_range or (0, 255)
    shares = {index: [(level - least) / (most - least) for level in rgb] for index, rgb in pattern.color_table.items()}
    table = {index: "#" + "".join(f"{round(255 * share):02x}" for share in rgb) for index, rgb in shares.items()}
    return DraftFile(
        title=one_line(pattern.name if pattern.name not in ("", "?", where) else path.stem, 100),
        program=one_line(f"{pattern.source_program} {pattern.source_version}".replace("?", "").strip(), 60),
        warp_over=_woven(pattern, ends, picks, where) ^ (not pattern.is_rising_shed),
        ends=_threads(pattern, "warp", ends, table, remarks),
        picks=_threads(pattern, "weft", picks, table, remarks),
        remarks=tuple(remarks),
    )


def _woven(pattern: PatternData, ends: int, picks: int, where: str) -> Bools:
    """Return where an end is on a shaft that its pick names, bool (picks, ends)."""
    threading, lifts = pattern.threading, make_liftplan(pattern)
    shafts = max([0, *(shaft for sets in (threading, lifts) for numbers in sets.values() for shaft in numbers)])
    if shafts > MOST_THREADS or min([0, *threading, *(shaft for each in threading.values() for shaft in each)]) < 0:
        raise BadInput(where, "[THREADING]", shafts, f"shafts from 1 to {MOST_THREADS} are needed")
    lifted = np.zeros((shafts + 1, picks), np.bool_)
    for pick, numbers in lifts.items():
        lifted[list(numbers), pick - 1] = True
    lifted[0] = False  # an end on shaft 0 is on none
    up = np.zeros((picks, ends), np.bool_)
    for end, numbers in threading.items():
        up[:, end - 1] = lifted[list(numbers)].any(axis=0)
    return up


def _threads(pattern: PatternData, axis: str, count: int, table: Mapping[int, str], remarks: list[str]) -> DraftThreads:
    yarns = getattr(pattern, axis)
    named = getattr(pattern, f"{axis}_colors")
    spacing = _mean(yarns.spacing, getattr(pattern, f"{axis}_spacing"), count)
    thickness = _mean(yarns.thickness, getattr(pattern, f"{axis}_thickness"), count)
    scale = CENTIMETRES.get((yarns.units or "").strip().lower())
    per_cm = 1 / (spacing * scale) if spacing and scale else None
    if per_cm is not None and not 0.1 <= per_cm <= 1000:
        remarks.append(f"[{axis.upper()}] has {per_cm:.3g} yarns per cm, which is not used: 0.1 to 1000 are allowed")
        per_cm = None
    if spacing and scale is None:
        stated = f"the unit {yarns.units!r}" if yarns.units else "no unit"
        remarks.append(one_line(f"[{axis.upper()}] Spacing has {stated}: known are {', '.join(CENTIMETRES)}", 160))
    colours = tuple(table[named.get(thread, yarns.color)] for thread in range(1, count + 1))
    return DraftThreads(colours, thickness / spacing if spacing and thickness else None, per_cm)


def _mean(default: float | None, own: Mapping[int, float], count: int) -> float | None:
    """Return the mean length over the threads; None if there is none, or it is no positive number."""
    if default is None:
        return None
    mean = math.fsum(own.get(thread, default) for thread in range(1, count + 1)) / count
    return mean if math.isfinite(mean) and mean > 0 else None
