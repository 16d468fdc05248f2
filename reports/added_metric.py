"""A metric from outside: a function of a method's answers on the held-out queries of a fabric."""

from __future__ import annotations

from pipeline.models.added.added_code import AddedFunction
from reports.catalogue import ADDED, Better, Format, MetricRow


class AddedMetric(AddedFunction):
    """A metric from outside the package."""

    better: Better
    """Direction of a better value."""
    format: Format
    """How tables print a value."""

    @property
    def row(self) -> MetricRow:
        """Its row of the catalogue."""
        return MetricRow(ADDED + self.name, self.title, self.definition, self.unit, self.better, self.format)
