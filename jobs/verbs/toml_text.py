"""Tables as TOML: what Python's `tomllib` reads, written.

JSON's numbers, strings and lists are TOML's but for a few characters; a table inside a list of values, or below a
section, becomes an inline table.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Mapping
from typing import Any


def toml(table: Mapping[str, Any]) -> str:
    """Return a document: values first, then tables as ``[sections]`` and lists of tables as ``[[sections]]``.

    Parameters
    ----------
    table : mapping
        Strings, numbers, truth values, lists and tables of those; None is left out, as TOML has no word for it.
    """
    return "\n".join(_section(table, ())).strip() + "\n"


def _section(table: Mapping[str, Any], path: tuple[str, ...]) -> Iterator[str]:
    """Yield the lines of a table: its values, then the sections below it."""
    below = {key: value for key, value in table.items() if isinstance(value, Mapping) or _of_tables(value)}
    for key, value in table.items():
        if key not in below and value is not None:
            yield f"{_key(key)} = {_value(value)}"
    for key, value in below.items():
        name = ".".join(map(_key, (*path, key)))
        for part in [value] if isinstance(value, Mapping) else value:
            yield from ("", f"[{name}]" if part is value else f"[[{name}]]")
            yield from _section(part, (*path, key))


def _of_tables(value: Any) -> bool:
    return isinstance(value, list | tuple) and bool(value) and all(isinstance(part, Mapping) for part in value)


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        parts = (f"{_key(key)} = {_value(part)}" for key, part in value.items() if part is not None)
        return f"{{{', '.join(parts)}}}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, float) and not math.isfinite(value):
        return repr(value)  # nan, inf, -inf: TOML's words as well
    # Characters beyond the first plane are written as they are: JSON's pairs of escapes are none of TOML's.
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _key(key: str) -> str:
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else _value(key)
