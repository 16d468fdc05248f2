"""Twills: straight, broken, herringbone."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from weaves.draft import cells
from weaves.errors import BadInput
from weaves.twill import broken_twill, herringbone, twill

steps = st.lists(st.tuples(st.integers(1, 4), st.integers(1, 4)), min_size=1, max_size=3)


@given(steps)
def test_twill_rises_to_the_side_it_is_named_after(pairs):
    over, under = zip(*pairs, strict=True)
    right = twill(over, under).warp_over
    left = twill(over, under, "left").warp_over
    # One pick up and one end to the right (left) is the same crossing again.
    assert np.array_equal(np.roll(right, (1, 1), (0, 1)), right)
    assert np.array_equal(np.roll(left, (1, -1), (0, 1)), left)


@given(steps)
def test_every_end_takes_the_same_steps(pairs):
    over, under = zip(*pairs, strict=True)
    draft = twill(over, under)
    assert draft.repeat == (sum(over) + sum(under),) * 2
    assert set(draft.warp_over.sum(axis=0)) == {sum(over)}


def test_a_3_1_twill_is_drawn_as_weavers_draw_it():
    assert twill([3], [1]).rows() == [".###", "###.", "##.#", "#.##"]
    assert twill([3], [1]).name == "twill 3/1"


def test_floats_of_a_stepped_twill():
    found = cells(twill([3, 1], [1, 2]))
    assert set(found.top_length[found.top == 0]) == {3.0, 1.0}


def test_the_four_end_broken_twill_takes_its_ends_as_0_1_3_2():
    straight = twill([3], [1]).warp_over
    assert np.array_equal(broken_twill([3], [1]).warp_over, straight[:, [0, 1, 3, 2]])


def test_herringbone_is_cut_where_it_turns():
    over = herringbone([2], [2]).warp_over
    assert over.shape == (4, 8)
    assert np.array_equal(over[:, :4], twill([2], [2]).warp_over)
    # Either side of a cut, every pick changes side: opposite ends.
    assert np.array_equal(over[:, 4], ~over[:, 3])
    assert np.array_equal(over[:, 0], ~over[:, 7])
    # The second stripe falls to the right.
    assert np.array_equal(over[:, 5], np.roll(over[:, 4], -1))


def test_herringbone_width():
    assert herringbone([2], [2], width=6).repeat == (12, 4)


@pytest.mark.parametrize(
    ("build", "key"),
    [
        (lambda: twill([], []), "under"),
        (lambda: twill([3, 1], [1]), "under"),
        (lambda: twill([0], [1]), "over"),
        (lambda: twill([100], [100]), "over"),
        (lambda: broken_twill([2], [1]), "over"),
        (lambda: herringbone([2], [2], width=1), "width"),
        (lambda: herringbone([2], [2], width=1000), "width"),
    ],
)
def test_what_is_no_twill_is_refused(build, key):
    with pytest.raises(BadInput) as refused:
        build()
    assert refused.value.key == key
