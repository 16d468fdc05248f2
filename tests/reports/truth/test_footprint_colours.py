import pytest

from reports.truth.footprint_colours import RECORDS, measure


@pytest.mark.slow
def test_mean_colours_lose_little_and_nothing_on_wide_footprints():
    found = list(measure(60, ["houndstooth"], [0.5, 16.0]))
    near, far = found
    assert 2.0 * far.loss < near.loss < 0.05 and abs(near.bias) < 0.03 and far.loss < 0.0025 and abs(far.bias) < 0.002
    assert RECORDS.from_records(RECORDS.to_records(found)) == found
