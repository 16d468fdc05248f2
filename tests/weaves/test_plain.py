"""Plain weave, rib and basket."""

import numpy as np
import pytest

from weaves.draft import cells
from weaves.errors import BadInput
from weaves.plain import basket, plain, rib


def test_plain_weave_has_opposite_neighbours_everywhere():
    over = plain().warp_over
    assert plain().repeat == (2, 2)
    for axis in (0, 1):
        assert np.array_equal(np.roll(over, 1, axis), ~over)


@pytest.mark.parametrize(("ends", "picks"), [(2, 2), (2, 3), (4, 2)])
def test_floats_of_a_basket_weave_span_the_groups(ends, picks):
    draft = basket(ends, picks)
    found = cells(draft)
    assert draft.repeat == (2 * ends, 2 * picks)
    assert set(found.top_length[found.top == 0]) == {float(picks)}
    assert set(found.top_length[found.top == 1]) == {float(ends)}


def test_rib_groups_one_direction_only():
    found = cells(rib(ends=1, picks=3))
    assert set(found.top_length[found.top == 0]) == {3.0}
    assert set(found.top_length[found.top == 1]) == {1.0}


@pytest.mark.parametrize("numbers", [(1, 1), (2, 2), (0, 1)])
def test_rib_needs_exactly_one_group(numbers):
    with pytest.raises(BadInput):
        rib(*numbers)


@pytest.mark.parametrize(("numbers", "key"), [((1, 2), "ends"), ((2, 1), "picks")])
def test_basket_needs_two_groups(numbers, key):
    with pytest.raises(BadInput) as refused:
        basket(*numbers)
    assert refused.value.key == key
