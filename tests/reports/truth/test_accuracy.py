import numpy as np
import pytest

from reports.truth.accuracy import COUNTS, RECORDS, SETTINGS, measure


@pytest.fixture(scope="module")
def found():
    return list(measure(rows=40, fabrics=["polyester_lining"], reference=1 << 13))


def named(found, setting):
    return next(row for row in found if row.setting == setting)


def test_every_setting_is_measured_on_the_same_queries_and_comes_back_from_records(found):
    assert [row.setting for row in found] == list(SETTINGS)
    assert {(row.fabric, row.count) for row in found} == {("polyester_lining", 40)}
    assert all(row.rate > 0 and row.points >= 32 for row in found)
    assert RECORDS.from_records(RECORDS.to_records(found)) == found


def test_more_points_are_more_accurate_and_saved_points_follow_from_the_errors(found):
    """Sixteen times the points of 40 queries: the median error of `mc` falls 4 times, give or take a factor of 2."""
    few, many = (named(found, f"mc, {count} points") for count in (64, 1024))
    assert 2 < few.true_error / many.true_error < 8 and named(found, "owen, 1024 points").saved > 1.5
    assert named(found, "auto at 1 %").true_error < 0.01
    # Twice the points and half the error: twice as many saved. Plain Monte Carlo saves nothing against itself.
    # The fit goes through the geometric mean of its own errors: so does the mean of what it saves, exactly.
    saved = [named(found, f"mc, {count} points").saved for count in COUNTS]
    assert np.exp(np.mean(np.log(saved))) == pytest.approx(1.0, rel=1e-9)
    squares = [row.saved * row.points * row.true_error**2 for row in found]
    assert squares == pytest.approx([squares[0]] * len(found), rel=1e-9)
