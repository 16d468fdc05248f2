"""Reading of small files from outside: recipes, fabrics, scenes, cards, manifests, Records.

Whoever wrote them may have meant harm. So only regular files are opened (no pipe, device or folder, which could be read
for ever), and no more than a stated number of bytes is read.
"""

import json
import os
import stat
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from weaves.errors import BadInput, brief, one_line

MIB: Final = 1 << 20  # bytes

MOST_TEXT: Final = MIB // 2
"""Most bytes of a TOML file. The largest fabric has 4,096 ends and picks in colours of their own: some 400 KB."""

MOST_VALUES: Final = 2_000_000
"""Most values of a JSON file: each takes up to 250 bytes in memory, even one of two letters."""

MOST_KEYS: Final = 256
"""Most keys of a JSON object: a validation reports every key that it does not know, at a kilobyte each."""


def read_bytes(path: Path, most: int, needed: str) -> bytes:
    """Return the content of a regular file of at most so many bytes; links are followed.

    `needed` is the kind of file, with its article, for messages: ``"a TOML file"``. FileNotFoundError if there is none,
    so that the caller can say what would make it; BadInput if it is no regular file, larger, or cannot be read.
    """
    where = str(path)
    if not isinstance(path, Path):  # of object storage, which has files only
        with path.open("rb") as file:
            content = file.read(most + 1)
        if len(content) > most:
            raise BadInput(where, "", f"has more than {most:,} bytes", f"at most {most:,} are allowed")
        return content
    try:
        # Without O_NONBLOCK, opening a pipe waits until somebody writes.
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
        with open(handle, "rb") as file:  # noqa: PTH123, there is a handle only
            found = os.fstat(handle)
            if not stat.S_ISREG(found.st_mode):
                raise BadInput(where, "", f"is {kind(found.st_mode)}", f"{needed} is needed")
            content = file.read(most + 1) if found.st_size <= most else b""
    except (FileNotFoundError, BadInput):
        raise
    except OSError as error:
        raise BadInput(where, "", error.strerror or "not readable", f"{needed} that can be read is needed") from error
    except ValueError as error:  # a zero byte in the path
        raise BadInput(where, "", one_line(error), f"the path of {needed} is needed") from error
    if found.st_size > most or len(content) > most:
        raise BadInput(where, "", f"has {max(found.st_size, len(content)):,} bytes", f"at most {most:,} are allowed")
    return content


def read_text(path: Path, most: int, needed: str) -> str:
    """Return the content of a file of UTF-8 text; otherwise as `read_bytes`."""
    try:
        return read_bytes(path, most, needed).decode()
    except UnicodeDecodeError as error:
        raise BadInput(str(path), "", f"byte {error.start} is not UTF-8", f"{needed} is needed") from error


def read_json(path: Path, most: int, needed: str, wide: Mapping[str, int] = MappingProxyType({})) -> Any:
    """Return the content of a JSON file, parsed; `wide` has the most keys of objects at some keys, else `MOST_KEYS`.

    Errors as `read_bytes`; BadInput also if it is no JSON, has more than `MOST_VALUES` values or too wide an object.
    """
    where, content = str(path), read_bytes(path, most, needed)
    if (commas := content.count(b",")) > MOST_VALUES:
        raise BadInput(where, "", f"has {commas:,} values", f"{needed} has at most {MOST_VALUES:,}")
    try:
        found = json.loads(content)
    except (ValueError, RecursionError) as error:  # JSONDecodeError, no UTF-8, numbers of absurd length
        reason = "nested too deeply" if isinstance(error, RecursionError) else one_line(error)
        raise BadInput(where, "", f"broken JSON ({reason})", f"{needed} is needed") from error
    left: list[tuple[str, Any]] = [("", found)] if isinstance(found, dict | list) else []
    while left:
        key, value = left.pop()
        inside = value.items() if isinstance(value, dict) else (("", item) for item in value)
        left += [one for one in inside if isinstance(one[1], dict | list)]
        if isinstance(value, dict) and len(value) > (allowed := wide.get(key, MOST_KEYS)):
            found = f"an object {brief(key)} with {len(value):,} keys" if key else f"an object with {len(value):,} keys"
            raise BadInput(where, "", found, f"at most {allowed:,} are allowed")
    return found


def refuse_irregular(path: Path, needed: str) -> None:
    """Refuse a path that is there and no regular file; for files that a library opens by their name."""
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError):
        return  # the library reports what is not there
    if not stat.S_ISREG(mode):
        raise BadInput(str(path), "", f"is {kind(mode)}", f"{needed} is needed")


def kind(mode: int) -> str:
    """Return the kind of a file that is not regular, with its article."""
    kinds = {stat.S_IFDIR: "a folder", stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket"}
    return kinds.get(stat.S_IFMT(mode), "a device")
