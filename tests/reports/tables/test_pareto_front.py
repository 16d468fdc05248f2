"""The front: its definition, on any points."""

import math

from hypothesis import given
from hypothesis import strategies as st

from reports.tables.pareto_front import front

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
