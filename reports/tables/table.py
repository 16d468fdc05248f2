"""A table of results as one object: words, columns and rows; the page, Markdown and the terminal show the same object.

Words come from `tables.toml`. A paragraph with a ``{value}`` that is not known is left out.
"""

from __future__ import annotations

import itertools
import math
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

import pandas as pd

from reports.catalogue import METRICS
from reports.over_seeds import LEAST, MOST
from reports.record import TRUTH
from reports.tables.number_format import FORMATS, NO_BREAK, display, span
from reports.tables.summary import BASELINE, rows

WORDS: Final = tomllib.loads(Path(__file__).with_name("tables.toml").read_text(encoding="utf-8"))
"""Words of sections and tables, and definitions of what is no metric."""


@dataclass(frozen=True)
class TableCell:
    """One number in words."""

    text: str
    interval: str = ""
    """95 % interval or quartiles."""
    range: str = ""
    """Range over trainings."""
    strong: bool = False

    def __str__(self) -> str:
        return " ".join(filter(None, (self.text, self.interval, self.range)))


class Column(NamedTuple):
    """A column: its title, and the cell of a row of a frame (`rows`) or of any other object."""

    title: str
    cell: Callable[[Any], TableCell | str]


@dataclass(frozen=True)
class TableRow:
    """One row; a row of a method knows it."""

    label: str
    cells: tuple[TableCell, ...]
    method: str = ""
    setting: str = ""
    kind: str = ""
    """``baseline``, ``noise`` or ``marked`` where a row is shown apart."""


@dataclass(frozen=True)
class ResultTable:
    """A table of results."""

    title: str
    columns: tuple[str, ...]
    """Headings; the first is that of the rows' labels."""
    rows: tuple[TableRow, ...]
    intro: tuple[str, ...] = ()
    note: tuple[str, ...] = ()
    key: str = ""
    """Role, scene or fabric that it is of, where there are several of a kind."""

    @property
    def groups(self) -> list[tuple[str, list[TableRow]]]:
        """Neighbouring rows of one method, with its name where they are several."""
        parts = [list(part) for _, part in itertools.groupby(self.rows, lambda row: row.method or row.label)]
        return [(display(part[0].method) if len(part) > 1 and part[0].method else "", part) for part in parts]

    def markdown(self) -> str:
        """Return the table in Markdown, without words."""
        return markdown_table(self.columns, [(row.label, *map(str, row.cells)) for row in self.rows])

    def numeric(self, index: int) -> bool:
        """Return whether a column holds numbers; the first, 0, does not."""
        texts = [row.cells[index - 1].text for row in self.rows] if index else []
        return any(text[:1] in "+−-.0123456789" for text in texts if text)


def number(
    name: str, title: str = "", worded: Callable[[float], str] | None = None, ends: tuple[str, str] | None = None
) -> Column:
    """Return the column of a number of a frame, with its interval and its range over trainings where it has them.

    Parameters
    ----------
    name : str
        Column of the frame. Of a metric, title and format are those of the catalogue.
    ends : (str, str), optional
        Columns of the interval's ends; <name>_low and <name>_high by default.
    """
    metric = METRICS.get(name)
    if metric:
        title = title or metric.title + (f", {metric.unit}" if metric.unit in ("dB", "JOD") else "")
        worded = worded or FORMATS[metric.format]
    low, high = ends or (f"{name}_low", f"{name}_high")
    assert worded is not None

    def cell(row: Any) -> TableCell:
        interval, trainings = (
            span(worded, getattr(row, first, math.nan), getattr(row, last, math.nan))
            for first, last in ((low, high), (name + LEAST, name + MOST))
        )
        return TableCell(worded(getattr(row, name)), interval.replace("[", "(").replace("]", ")"), trainings)

    return Column(title.replace(" ", NO_BREAK) if len(title) < 12 else title, cell)


def cells(row: Any, columns: Iterable[Column]) -> tuple[TableCell, ...]:
    """Return the cells of a row."""
    made = (column.cell(row) for column in columns)
    return tuple(cell if isinstance(cell, TableCell) else TableCell(cell) for cell in made)


def method_row(method: str, setting: str, made: Iterable[TableCell]) -> TableRow:
    """Return the row of a method."""
    kind = "baseline" if (method, setting) == BASELINE else ""
    return TableRow(
        "the truth" if method == TRUTH else display(method, setting),
        tuple(made),
        method,
        setting.replace(" ", NO_BREAK),
        kind,
    )


def by_method(lines: Sequence[TableRow]) -> list[TableRow]:
    """Return rows with all settings of a method together."""
    order = list(dict.fromkeys(line.method for line in lines))
    return sorted(lines, key=lambda line: order.index(line.method))


def table(
    name: str, columns: Sequence[str], lines: Iterable[TableRow], values: Mapping[str, object], key: str = ""
) -> ResultTable:
    """Return the table `name` of `tables.toml` with its words."""
    own = WORDS["tables"][name]
    title = own["title"].format_map(values)
    intro, note = (tuple(paragraphs(own.get(part, []), values)) for part in ("intro", "note"))
    return ResultTable(title, tuple(columns), tuple(lines), intro, note, key)


def of_methods(
    name: str, frame: pd.DataFrame, columns: Sequence[Column], values: Mapping[str, object], key: str = ""
) -> ResultTable:
    """Return the table of a frame with a row a method."""
    lines = [method_row(row.method, row.setting, cells(row, columns)) for row in rows(frame)]
    return table(name, ["method", *(column.title for column in columns)], by_method(lines), values, key)


def of_rows(
    name: str, objects: Iterable[Any], columns: Sequence[Column], values: Mapping[str, object], key: str = ""
) -> ResultTable:
    """Return the table of any objects, whose first column labels the rows; those that do not hold are marked."""
    lines = []
    for row in objects:
        label, *others = cells(row, columns)
        lines.append(TableRow(label.text, tuple(others), kind="" if getattr(row, "holds", True) else "marked"))
    return table(name, [column.title for column in columns], lines, values, key)


def paragraphs(texts: Iterable[str], values: Mapping[str, object]) -> list[str]:
    """Return texts with their values; those with a value that is not known are left out."""
    made = []
    for text in texts:
        try:
            made.append(text.format_map(values))
        except KeyError:
            continue
    return made


def markdown_table(columns: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table; every line has as many cells as there are columns, numbers stand on the right."""
    rule = [":--", *["--:"] * (len(columns) - 1)]
    return "\n".join(f"| {' | '.join(line)} |" for line in (columns, rule, *lines))
