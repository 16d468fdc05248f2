"""Markdown: tables, and blocks of a file that a command writes."""

from __future__ import annotations

from collections.abc import Sequence

from weaves.errors import BadInput


def markdown_table(columns: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """Return a table; every line has as many cells as there are columns, numbers stand on the right."""
    rule = [":--", *["--:"] * (len(columns) - 1)]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (columns, rule, *lines))


def markers(name: str) -> tuple[str, str]:
    """Return the lines before and after a generated block."""
    return f"<!-- {name}: written by `make readme`, do not edit -->", f"<!-- end of {name} -->"


def block(text: str, name: str, where: str) -> str:
    """Return the generated block of a text, without its markers.

    Raises
    ------
    BadInput
        If the text does not hold both markers, the first one first; `where` names the file.
    """
    first, last = markers(name)
    _, found, after = text.partition(f"{first}\n")
    inside, closed, _ = after.partition(f"{last}\n")
    if not found or not closed:
        raise BadInput(where, "", f"has no block {name!r}", f"the lines {first!r} and {last!r} are needed")
    return inside


def with_block(text: str, name: str, content: str, where: str) -> str:
    """Return a text with another generated block; BadInput as `block`."""
    old = block(text, name, where)
    first, last = markers(name)
    return text.replace(f"{first}\n{old}{last}\n", f"{first}\n{content.rstrip()}\n{last}\n", 1)
