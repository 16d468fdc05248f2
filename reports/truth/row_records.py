"""Dataclasses as Records and back: one Record for each measured field of a row.

A measured field is annotated with its metric (`reports.catalogue`), the others name what was measured. A field that is
NaN has no Record; reading gives it the default of its class.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, dataclass, field, fields
from functools import cached_property
from typing import Any, Generic, TypeVar, get_type_hints

from reports.catalogue import METRICS
from reports.record import TRUTH, Metric, Record

Row = TypeVar("Row")


@dataclass(frozen=True)
class RowRecords(Generic[Row]):
    """How the rows of one measurement are written as Records."""

    row: type[Row]  # a dataclass; ``Annotated[float, "traced_error"]`` is the type of a measured field
    setting: tuple[str, ...]
    """Fields that together are the setting, joined by `joint`; only the last one may hold the separator."""
    method: str = TRUTH
    method_field: str = ""  # field that holds the method; empty if it is `method`
    once: Mapping[str, str] = field(default_factory=dict)
    """Attributes of the Record of the first metric, such as ``note``, and the field that each holds."""
    joint: str = " | "

    @cached_property
    def metrics(self) -> dict[str, Metric]:
        """Metric of each measured field, in the order of the catalogue."""
        types = get_type_hints(self.row, include_extras=True)
        fields_of = {kind.__metadata__[0]: name for name, kind in types.items() if hasattr(kind, "__metadata__")}
        return {fields_of[metric]: metric for metric in METRICS if metric in fields_of}

    @property
    def table(self) -> str:
        """Name of the table that shows the rows: that of their metrics."""
        return METRICS[next(iter(self.metrics.values()))].table

    def to_records(self, found: Iterable[Row]) -> list[Record]:
        """Return one Record for each number."""
        records = []
        for row in map(vars, found):
            method = row[self.method_field] if self.method_field else self.method
            setting = self.joint.join(row[name] for name in self.setting)
            subject = Record(method=method, setting=setting, fabric=row.get("fabric", ""))
            once = {attribute: row[name] for attribute, name in self.once.items()}
            for index, (name, metric) in enumerate(self.metrics.items()):
                if not math.isnan(value := float(row[name])):
                    record = subject.of(metric, value, row["count"])
                    records.append(record if index else record.model_copy(update=once))
        return records

    def from_records(self, records: Iterable[Record]) -> list[Row]:
        """Return the rows that Records hold, in their order; other metrics and rows that lack a field are left out."""
        names = {metric: name for name, metric in self.metrics.items()}
        first = next(iter(names))
        rows: dict[tuple[str, str, str], dict[str, Any]] = {}
        for record in records:
            if record.metric in names and record.setting.count(self.joint) >= len(self.setting) - 1:
                row = rows.setdefault((record.method, record.setting, record.fabric), self._named(record))
                row[names[record.metric]] = record.value
                if record.metric == first:
                    row |= {name: getattr(record, attribute) for attribute, name in self.once.items()}
        needed = {part.name for part in fields(self.row) if part.default is MISSING}  # type: ignore[arg-type]
        types = get_type_hints(self.row)
        return [
            self.row(**{name: int(value) if types[name] is int else value for name, value in row.items()})
            for row in rows.values()
            if needed <= row.keys()
        ]

    def _named(self, record: Record) -> dict[str, Any]:
        """Return the fields that name a Record's row."""
        parts = record.setting.split(self.joint, len(self.setting) - 1)
        named = {"count": record.count, "fabric": record.fabric, self.method_field: record.method}
        named |= zip(self.setting, parts, strict=True)
        return {part.name: named[part.name] for part in fields(self.row) if part.name in named}  # type: ignore[arg-type]
