"""The catalogue: one row a metric."""

import pytest
from pydantic import ValidationError

from reports.record import Record


def test_a_metric_without_a_row_is_refused():
    with pytest.raises(ValidationError, match="'largest_error' is no metric"):
        Record(method="woven", metric="largest_error")
