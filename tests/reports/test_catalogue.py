"""The catalogue: one row a metric."""

import pytest
from pydantic import ValidationError

from reports.catalogue import METRICS
from reports.record import Record


def test_a_metric_without_a_row_is_refused():
    with pytest.raises(ValidationError, match="'largest_error' is no metric"):
        Record(method="woven", metric="largest_error")


def test_every_row_is_named_as_its_key_and_has_a_title():
    assert all(row.name == name and row.title for name, row in METRICS.items())
