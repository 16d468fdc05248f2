"""Catalogue of the metrics: an entry of `catalogue.toml` each. A new metric is an entry and a measuring function.

The entry names the table that shows the metric; its column needs nothing else. Nothing heavy is imported here.
"""

import tomllib
from pathlib import Path
from typing import Final, Literal, NamedTuple

from pipeline.models.added.added_code import AddedFunction

Better = Literal["lower", "higher", "near 0", ""]  # direction of a better value; empty where none is better

Format = Literal[
    "scientific", "signed", "percent", "fine percent", "whole percent", "three decimals", "two decimals", "one decimal",
    "significant", "grouped", "bytes", "seconds", "times",
]  # fmt: skip
"""How tables print a value (`reports.tables.number_format.shown`)."""

ADDED: Final = "added_"  # begins the names of metrics from outside the package
OTHER: Final = "other_metrics"  # table of the metrics that have no table of their own


class MetricRow(NamedTuple):
    """One metric."""

    name: str  # name in Records and tables
    title: str  # heading of its column on the page
    definition: str = ""  # explanation on the page; empty where a table's text explains it
    unit: str = "1"  # unit of its values; a Record with a unit of its own overrides it
    better: Better = "lower"
    format: Format = "significant"
    table: str = OTHER  # table that shows it
    of_machine: bool = False  # True if its values are those of one machine: times, rates, memory
    shown: bool = True  # True if it is a column of its table as it is


_CONTENT: Final = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))

BENCH: Final[int] = _CONTENT.pop("version")
"""Version of the measurements of methods and of the truth; also written into every Record."""

METRICS: Final = {
    name: MetricRow(name, table=table, **entry)
    for table, entries in _CONTENT.items()
    for name, entry in entries.items()
}
"""All metrics by name, in the order of the file."""


class AddedMetric(AddedFunction):
    """A metric from outside: a function of a method's answers on the held-out queries of a fabric."""

    better: Better
    format: Format

    @property
    def row(self) -> MetricRow:
        """Its row of the catalogue."""
        return MetricRow(ADDED + self.name, self.title, self.definition, self.unit, self.better, self.format)


def columns_of(table: str) -> list[str]:
    """Return the metrics that are columns of a table."""
    return [name for name, row in METRICS.items() if row.table == table and row.shown]


def metric_row(metric: str) -> MetricRow:
    """Return the row of a metric; one from outside that was not entered (`enter`) has little more than its name.

    KeyError if there is no such metric.
    """
    if metric not in METRICS and metric.startswith(ADDED):
        return MetricRow(metric, metric.removeprefix(ADDED).replace("_", " "))
    return METRICS[metric]


def enter(row: MetricRow) -> None:
    """Enter a metric from outside in this process."""
    METRICS[row.name] = row
