"""The front of error against time: its definition, on any points, and the tables made of it."""

import math

import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reports.tradeoff import cheapest, front, tradeoff_table

# Few values, so that ties are frequent; and some that were not measured.
NUMBERS = st.sampled_from([0.0, 1.0, 2.0, 3.0, 5.0, 8.0]) | st.floats(-1e9, 1e9) | st.sampled_from([math.nan, math.inf])
POINTS = st.lists(st.tuples(NUMBERS, NUMBERS), max_size=30)


def measured(point):
    return math.isfinite(point[0]) and math.isfinite(point[1])


def beats(one, other):
    return measured(one) and one[0] <= other[0] and one[1] <= other[1] and one != other


@given(POINTS)
def test_nothing_beats_the_front_and_something_beats_all_others(points):
    for point, on in zip(points, front(points), strict=True):
        if measured(point):
            assert on == (not any(beats(other, point) for other in points))
        else:
            assert not on


@given(POINTS, st.randoms(use_true_random=False))
def test_the_order_of_the_points_does_not_matter(points, random):
    order = list(range(len(points)))
    random.shuffle(order)
    on = front(points)
    assert front([points[index] for index in order]) == [on[index] for index in order]


@given(POINTS)
def test_every_measured_point_has_one_of_the_front_that_is_as_good(points):
    best = [point for point, on in zip(points, front(points), strict=True) if on]
    for point in filter(measured, points):
        assert any(one[0] <= point[0] and one[1] <= point[1] for one in best)


def test_ties():
    assert front([(1, 2), (1, 2), (1, 3), (2, 2), (2, 1)]) == [True, True, False, False, True]
    assert front([]) == []


ERRORS = pd.DataFrame(
    [
        ("slow", "", "seen", 2, 0.01),
        ("fast", "k = 1", "seen", 2, 0.2),
        ("fast", "k = 2", "seen", 2, 0.1),
        ("poor", "", "seen", 2, 0.15),
        ("narrow", "", "seen", 1, 0.001),
        ("lost", "", "seen", 2, 0.0),
        ("untimed", "", "seen", 2, 0.001),
        ("fast", "k = 1", "unseen", 1, 0.3),
    ],
    columns=["method", "setting", "role", "fabrics", "colour_rrmse"],
)
TIMING = pd.DataFrame(
    [
        ("slow", "", 900.0, 1.0),
        ("fast", "k = 1", 100.0, 1.0),
        ("fast", "k = 2", 200.0, 1.0),
        ("poor", "", 300.0, 1.0),
        ("narrow", "", 10.0, 1.0),
        ("lost", "", 10.0, 1.0),
        ("truth", "", 9e4, math.nan),
    ],
    columns=["method", "setting", "median_ns", "bytes_stored"],
)


@pytest.fixture
def table():
    return tradeoff_table(ERRORS, TIMING)


def test_the_table_compares_what_answers_for_the_same_fabrics(table):
    """A method of a single fabric has an easier mean; one below the noise has no error; what lacks a time is out."""
    found = {(row.role, row.method, row.setting): row.front for row in table.itertuples()}
    assert found == {
        ("seen", "slow", ""): True,
        ("seen", "fast", "k = 1"): True,
        ("seen", "fast", "k = 2"): True,
        ("seen", "poor", ""): False,
        ("seen", "lost", ""): False,
        ("unseen", "fast", "k = 1"): True,
    }


def test_the_cheapest_within_an_error(table):
    seen = table[table["role"] == "seen"]
    assert (cheapest(seen, 0.25).method, cheapest(seen, 0.25).setting) == ("fast", "k = 1")
    assert cheapest(seen, 0.1).setting == "k = 2"
    assert cheapest(seen, 0.05).method == "slow"
    assert cheapest(seen, 0.005) is None


def test_nothing_measured_gives_an_empty_table():
    for errors, timing in ((ERRORS[:0], TIMING), (ERRORS, TIMING[:0])):
        table = tradeoff_table(errors, timing)
        assert table.empty and "front" in table
