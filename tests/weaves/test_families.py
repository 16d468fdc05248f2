"""Families of weaves: plain, rib, basket, satins, and twills straight, broken and in herringbone."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from weaves.draft import cells
from weaves.errors import BadInput
from weaves.families import basket, broken_twill, herringbone, plain, rib, sateen, satin, twill, valid_moves

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


@given(st.integers(-3, 24), st.integers(-3, 24))
def test_a_satin_binds_every_end_once_apart_from_its_neighbours_or_is_refused(ends, move):
    """Oracle: build the binding points by stepping, and look at them; no number theory."""
    points = [pick * move % ends for pick in range(ends)] if ends > 0 else []
    following = [*points[1:], *points[:1]]
    neighbours = [(after - before) % ends in (0, 1, ends - 1) for before, after in zip(points, following, strict=True)]
    possible = ends >= 5 and 0 < move < ends and len(set(points)) == ends and not any(neighbours)
    try:
        bound = ~satin(ends, move).warp_over
    except BadInput:
        assert not possible
        return
    assert possible
    assert (bound.sum(axis=0) == 1).all()
    assert [int(np.flatnonzero(pick)[0]) for pick in bound] == points


def test_sateen_is_the_satin_with_warp_and_weft_exchanged():
    assert np.array_equal(sateen(8, 3).warp_over, ~satin(8, 3).warp_over)


def test_classical_moves():
    assert [valid_moves(ends) for ends in (5, 6, 7, 8)] == [[2, 3], [], [2, 3, 4, 5], [3, 5]]


def test_the_impossible_satin_of_6_says_what_is_possible():
    with pytest.raises(BadInput, match=r"move = 3: .*6 ends allow none; try 5 or 7 ends"):
        satin(6, 3)
    with pytest.raises(BadInput, match=r"8 ends allow 3, 5"):
        satin(8, 2)


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
