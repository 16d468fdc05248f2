"""Satins: which moves exist, and what they weave."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from weaves.errors import BadInput
from weaves.satin import sateen, satin, valid_moves


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
