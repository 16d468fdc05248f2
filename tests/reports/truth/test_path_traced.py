import math

import pytest

from pipeline.scenes.variant import llvm_works, mitsuba
from reports.truth import path_traced
from reports.truth.path_traced import OTHER, OURS, RECORDS, Traced, measure


@pytest.mark.slow
@pytest.mark.skipif(not llvm_works(), reason="no LLVM that Mitsuba can use")
def test_every_method_has_an_error_and_a_time():
    """A frame of 4 by 4 pixels; the reference is of the same method, so that its own error is noise alone."""
    import mitsuba as mi

    before = mi.variant()
    mitsuba()
    found = list(measure(("sphere",), 4, {OURS: (1,), OTHER: (1, 2)}, (OURS, 4), 2))
    if before is not None:
        mi.set_variant(before)
    assert [(one.method, one.samples) for one in found] == [(OTHER, "1"), (OTHER, "2"), (OURS, "1")]
    for one in found:
        assert math.isfinite(one.error) and one.seconds > 0 and one.count == 2
        assert math.isnan(one.gain) == (one.method == OTHER)
    both = (RECORDS.from_records(RECORDS.to_records(found)), found)
    back, there = ([(one.method, one.fabric, one.samples, one.error) for one in rows] for rows in both)
    assert back == there


def test_errors_between_two_times_follow_a_power_law():
    """1 and 4 seconds with errors 8 and 2: 4 at 2 seconds; 8 before, unknown after; noise below 0 is left out."""
    rows = [Traced(OTHER, "x", str(n), error, n, 1) for n, error in ((4.0, 2.0), (1.0, 8.0), (9.0, -0.1))]
    assert [path_traced._error_in(t, rows) for t in (0.5, 2.0)] == pytest.approx([8.0, 4.0])
    assert math.isnan(path_traced._error_in(5.0, rows))
