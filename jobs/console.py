"""Tables and cells of the terminal, as all verbs print them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from rich.table import Table

from jobs.terminal import Terminal

if TYPE_CHECKING:
    from reports.tables.table import ResultTable

MOST_SENTENCES: Final = 20
"""Most sentences of one kind that a verb prints; it counts the others."""


def table_of(*columns: str, right: Sequence[str] = ()) -> Table:
    """Return an empty table with these columns."""
    table = Table(box=None, pad_edge=False, header_style="bold", caption_justify="left")
    for column in columns:
        table.add_column(column, justify="right" if column in right else "left")
    return table


def print_result(result: ResultTable) -> None:
    """Print a table of results after an empty line; marked rows are bold."""
    columns = enumerate(result.columns)
    table = table_of(*result.columns, right=[name for index, name in columns if result.numeric(index)])
    table.title, table.title_justify = result.title, "left"
    for row in result.rows:
        table.add_row(row.label, *map(str, row.cells), style="bold" if row.kind == "marked" else "")
    Terminal().print("", table)


def print_line(sentence: str) -> None:
    """Print a sentence to stderr as it is, in one line."""
    Terminal(stderr=True).print(sentence, soft_wrap=True)


def duration(seconds: float) -> str:
    """Write a time as a person would say it."""
    if seconds < 120:
        return f"{seconds:.0f} s"
    if seconds < 2 * 3600:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h" if seconds < 48 * 3600 else f"{seconds / 86400:.1f} days"


def size(count: float) -> str:
    """Write a number of bytes."""
    for unit in ("B", "kB", "MB", "GB"):
        if count < 1000:
            return f"{count:.3g} {unit}"
        count /= 1000
    return f"{count:.3g} TB"


def number(value: float) -> str:
    """Write a measured number with three digits; a missing one as a dash."""
    if value != value:
        return "–"
    if 0 < abs(value) < 0.01:
        return f"{value:.1e}"
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"
