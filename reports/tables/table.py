"""A table of results as one object: words, columns and rows; the page, Markdown and the terminal show the same object.

Words and columns come from `tables.toml`. A paragraph with a ``{value}`` that is not known is left out.
"""

import itertools
import math
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, NamedTuple

import pandas as pd

from reports.catalogue import METRICS, columns_of
from reports.over_seeds import LEAST, MOST
from reports.record import TRUTH
from reports.tables.number_format import FORMATS, NO_BREAK, beyond_noise, display, span
from reports.tables.summary import BASELINE, rows

WORDS: Final = tomllib.loads(Path(__file__).with_name("tables.toml").read_text(encoding="utf-8"))
"""Words of sections and tables, columns of tables, and definitions of what is no metric."""

Values = Mapping[str, object]  # of words


class TableCell(NamedTuple):
    """One number in words."""

    text: str
    interval: str = ""  # 95 % interval or quartiles
    range: str = ""  # over trainings
    strong: bool = False

    def __str__(self) -> str:
        return " ".join(filter(None, (self.text, self.interval, self.range)))


class Column(NamedTuple):
    """A column: its title, and the cell of a row of a frame (`rows`) or of any other object."""

    title: str
    cell: Callable[[Any], TableCell]


class TableRow(NamedTuple):
    """One row; a row of a method knows it."""

    label: str
    cells: tuple[TableCell, ...]
    method: str = ""
    setting: str = ""
    kind: str = ""  # ``baseline``, ``noise`` or ``marked`` where a row is shown apart


class ResultTable(NamedTuple):
    """A table of results."""

    title: str
    columns: tuple[str, ...]  # headings; the first is that of the rows' labels
    rows: tuple[TableRow, ...]
    intro: tuple[str, ...] = ()
    note: tuple[str, ...] = ()
    key: str = ""  # role, scene or fabric that it is of, where there are several of a kind

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
    name: str, title: str = "", format: str = "", metric: str = "", ends: Sequence[str] = (), above_noise: bool = False
) -> Column:
    """Return the column of a number of a frame, with its interval and its range over trainings where it has them.

    Title and format, a key of `FORMATS`, are by default those of the metric: `metric`, or that of the column's name.
    The columns of the interval's `ends` are by default <name>_low and <name>_high. With `above_noise` a number that is
    not above 0 is lost in the noise of the truth.
    """
    if about := METRICS.get(metric or name):
        title = title or about.title + (f", {about.unit}" if about.unit in ("dB", "JOD") else "")
        format = format or about.format
    low, high = ends or (f"{name}_low", f"{name}_high")

    def worded(value: float) -> str:
        return beyond_noise(value, FORMATS[format]) if above_noise else FORMATS[format](value)

    def cell(row: Any) -> TableCell:
        interval, trainings = (
            span(worded, getattr(row, first, math.nan), getattr(row, last, math.nan))
            for first, last in ((low, high), (name + LEAST, name + MOST))
        )
        return TableCell(worded(getattr(row, name)), interval.replace("[", "(").replace("]", ")"), trainings)

    return Column(title.replace(" ", NO_BREAK) if len(title) < 12 else title, cell)


def text(title: str, worded: Callable[[Any], str]) -> Column:
    """Return a column of words about a row."""
    return Column(title, lambda row: TableCell(worded(row)))


def columns_for(name: str, values: Values, measured: Iterable[str] = ()) -> dict[str, Column]:
    """Return the columns of a table by their names in its frame.

    They are those of `tables.toml`, then the catalogue's for this table, as far as they are among the `measured`.
    """
    columns = {}
    for column, about in WORDS["tables"][name].get("columns", {}).items():
        title = about.get("title", "").format_map(values)
        columns[column] = number(column, **{**about, "title": title})
    return columns | {metric: number(metric) for metric in columns_of(name) if metric in {*measured} - {*columns}}


def method_row(method: str, setting: str, cells: Iterable[TableCell]) -> TableRow:
    """Return the row of a method."""
    label = "the truth" if method == TRUTH else display(method, setting)
    kind = "baseline" if (method, setting) == BASELINE else ""
    return TableRow(label, tuple(cells), method, setting.replace(" ", NO_BREAK), kind)


def table(name: str, columns: Sequence[str], lines: Iterable[TableRow], values: Values, key: str = "") -> ResultTable:
    """Return the table `name` of `tables.toml` with its words."""
    own = WORDS["tables"][name]
    title = own["title"].format_map(values)
    intro, note = (tuple(paragraphs(own.get(part, []), values)) for part in ("intro", "note"))
    return ResultTable(title, tuple(columns), tuple(lines), intro, note, key)


def of_methods(
    name: str, frame: pd.DataFrame, values: Values, columns: Mapping[str, Column] | None = None, key: str = ""
) -> ResultTable:
    """Return the table of a frame with a row a method, all settings of a method together.

    Its columns are those of `columns_for`, or others.
    """
    shown = (columns_for(name, values, frame.columns) if columns is None else columns).values()
    lines = [method_row(row.method, row.setting, [column.cell(row) for column in shown]) for row in rows(frame)]
    order = list(dict.fromkeys(line.method for line in lines))
    lines.sort(key=lambda line: order.index(line.method))
    return table(name, ["method", *(column.title for column in shown)], lines, values, key)


def of_rows(name: str, objects: Iterable[Any], columns: Sequence[Column], values: Values) -> ResultTable:
    """Return the table of any objects, whose first column labels the rows; those that do not hold are marked."""
    lines = []
    for row in objects:
        label, *others = (column.cell(row) for column in columns)
        lines.append(TableRow(label.text, tuple(others), kind="" if getattr(row, "holds", True) else "marked"))
    return table(name, [column.title for column in columns], lines, values)


def paragraphs(texts: Iterable[str], values: Values) -> list[str]:
    """Return texts with their values; those with a value that is not known are left out."""
    made = []
    for text in texts:
        with suppress(KeyError):
            made.append(text.format_map(values))
    return made


def markdown_table(columns: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table; every line has as many cells as there are columns, numbers stand on the right."""
    rule = [":--", *["--:"] * (len(columns) - 1)]
    return "\n".join(f"| {' | '.join(line)} |" for line in (columns, rule, *lines))
