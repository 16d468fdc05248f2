import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from weaves.draft import Loom, cells
from weaves.families import Basket, Herringbone, Plain, Rib, Satin, Twill

steps = st.lists(st.tuples(st.integers(1, 4), st.integers(1, 4)), min_size=1, max_size=3)


@given(steps)
def test_every_end_takes_the_same_steps_and_the_twill_rises_to_the_side_it_is_named_after(pairs):
    over, under = zip(*pairs, strict=True)
    for direction, side in (("right", 1), ("left", -1)):
        draft = Twill(over=over, under=under, direction=direction).build()
        # One pick up and one end to the side is the same crossing again.
        assert np.array_equal(np.roll(draft.warp_over, (1, side), (0, 1)), draft.warp_over)
        assert draft.repeat == (sum(over) + sum(under),) * 2 and set(draft.warp_over.sum(axis=0)) == {sum(over)}


def test_twills_are_drawn_as_weavers_do_broken_by_their_ends_and_herringbone_cut_where_it_turns():
    straight, broken = (Twill(family=family, over=3, under=1).build() for family in ("twill", "broken_twill"))
    assert straight.rows() == [".###", "###.", "##.#", "#.##"] and straight.name == "twill 3/1"
    assert np.array_equal(broken.warp_over, straight.warp_over[:, [0, 1, 3, 2]])
    over = Herringbone(over=2, under=2).build().warp_over
    assert over.shape == (4, 8) and np.array_equal(over[:, :4], Twill(over=2, under=2).build().warp_over)
    # Either side of a cut, every pick changes side: opposite ends.
    assert np.array_equal(over[:, [4, 0]], ~over[:, [3, 7]])
    # The second stripe falls to the right.
    assert np.array_equal(over[:, 5], np.roll(over[:, 4], -1))
    assert Herringbone(over=2, under=2, width=6).build().repeat == (12, 4)


LOOM = {"threading": (1,), "tie_up": ((1, 0),), "treadling": (1,)}


@pytest.mark.parametrize(
    ("family", "numbers", "key"),
    [
        (Twill, {"over": (3, 1), "under": 1}, "under"),
        (Twill, {"over": (100, 40), "under": (100, 40)}, "over"),
        (Twill, {"family": "broken_twill", "over": 2, "under": 1}, "over"),
        (Herringbone, {"over": 3, "under": 3, "width": 129}, "width"),
        (Satin, {"ends": 6, "move": 3}, "move = 3: .*6 ends allow none; try 5 or 7 ends"),
        (Satin, {"ends": 8, "move": 2}, "8 ends allow 3, 5"),
        (Rib, {"ends": 1, "picks": 1}, "picks"),
        (Rib, {"ends": 2, "picks": 2}, "picks"),
        (Loom, LOOM | {"threading": (1, 3)}, "threading"),
        (Loom, LOOM | {"treadling": (0,)}, "treadling"),
        (Loom, LOOM | {"tie_up": ()}, "tie_up"),
        (Loom, LOOM | {"tie_up": ((1, 0), (1,))}, "tie_up"),
    ],
)
def test_numbers_that_make_no_weave_are_refused(family, numbers, key):
    with pytest.raises(ValidationError, match=key):
        family(**numbers)


@given(st.integers(-3, 24), st.integers(-3, 24))
def test_a_satin_binds_every_end_once_apart_from_its_neighbours_or_is_refused(ends, move):
    """Oracle: build the binding points by stepping, and look at them; no number theory."""
    points = [pick * move % ends for pick in range(ends)] if ends > 0 else []
    following = [*points[1:], *points[:1]]
    neighbours = [(after - before) % ends in (0, 1, ends - 1) for before, after in zip(points, following, strict=True)]
    possible = ends >= 5 and 0 < move < ends and len(set(points)) == ends and not any(neighbours)
    try:
        bound = ~Satin(ends=ends, move=move).build().warp_over
    except ValidationError:
        assert not possible
        return
    assert possible and (bound.sum(axis=0) == 1).all() and [int(np.flatnonzero(pick)[0]) for pick in bound] == points
    assert np.array_equal(Satin(family="sateen", ends=ends, move=move).build().warp_over, bound)


@pytest.mark.parametrize(
    ("weave", "repeat", "warp", "weft"),
    [
        (Plain(), (2, 2), {1.0}, {1.0}),
        (Basket(ends=2, picks=2), (4, 4), {2.0}, {2.0}),
        (Basket(ends=2, picks=3), (4, 6), {3.0}, {2.0}),
        (Basket(ends=4, picks=2), (8, 4), {2.0}, {4.0}),
        (Rib(ends=1, picks=3), (2, 6), {3.0}, {1.0}),
        (Twill(over=3, under=1), (4, 4), {3.0}, {1.0}),
        (Twill(over=(3, 1), under=(1, 2)), (7, 7), {3.0, 1.0}, {2.0, 1.0}),
    ],
    ids=str,
)
def test_floats_span_the_groups_and_the_steps(weave, repeat, warp, weft):
    draft = weave.build()
    floats = cells(draft)
    assert draft.repeat == repeat and set(floats.top_length[floats.top == 0]) == warp
    assert set(floats.top_length[floats.top == 1]) == weft
