import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from pydantic import ValidationError

from tests.refusals import refusal
from weaves.draft import LARGEST_REPEAT, Draft, Loom, Matrix, cells
from weaves.families import Plain, Twill

matrices = hnp.arrays(np.bool_, hnp.array_shapes(min_dims=2, max_dims=2, max_side=7))


def run_by_walking(side, place):
    """Walk cell by cell from `place` to both ends of its run on a cyclic line."""
    count = len(side)
    if all(value == side[0] for value in side):
        return np.inf, 0.0
    ahead = next(step for step in range(1, count + 1) if side[(place + step) % count] != side[place]) - 1
    behind = next(step for step in range(1, count + 1) if side[(place - step) % count] != side[place]) - 1
    return ahead + behind + 1, (behind - ahead) / 2


@given(matrices)
def test_floats_agree_with_a_walk_and_the_loom_weaves_the_drawing_with_as_few_shafts_as_can_be(matrix):
    found = cells(Draft(matrix))
    for pick, end in np.ndindex(matrix.shape):
        warp = run_by_walking(list(matrix[:, end]), pick)
        weft = run_by_walking(list(matrix[pick]), end)
        top, under = (warp, weft) if matrix[pick, end] else (weft, warp)
        expected = (int(not matrix[pick, end]), *top[::-1], *under[::-1])
        assert tuple(column[pick, end] for column in found) == expected
    draft = Draft(matrix)
    assert Matrix(rows=draft.rows()).build() == draft and draft.text().count("██") == matrix.sum()
    loom = Draft(matrix).loom()
    assert loom.build() == Draft(matrix) and loom.threading[0] == loom.treadling[0] == 1
    assert (len(loom.tie_up), len(loom.tie_up[0])) == tuple(
        len(np.unique(lines, axis=0)) for lines in (matrix, matrix.T)
    )


@given(hnp.arrays(np.bool_, hnp.array_shapes(min_dims=2, max_dims=2, max_side=4)))
def test_cloth_hangs_together_unless_some_yarns_lie_on_all_others(matrix):
    """By the definition: every choice of yarns is tried."""
    picks, ends = matrix.shape

    def lies_on_the_others(upper_ends, upper_picks):
        over_lower_picks = all(matrix[j, i] for i in upper_ends for j in set(range(picks)) - upper_picks)
        return over_lower_picks and not any(matrix[j, i] for j in upper_picks for i in set(range(ends)) - upper_ends)

    def choices(count):
        return [{i for i in range(count) if number >> i & 1} for number in range(2**count)]

    loose = any(
        lies_on_the_others(upper_ends, upper_picks)
        for upper_ends in choices(ends)
        for upper_picks in choices(picks)
        if 0 < len(upper_ends) + len(upper_picks) < ends + picks
    )
    assert Draft(matrix).hangs_together() == (not loose)


def test_drawing_has_pick_0_at_the_bottom_and_drafts_are_read_only_copies_that_survive_pickling():
    draft = Matrix(rows=["#..", "##."]).build()
    assert draft.repeat == (3, 2) and draft.warp_over.tolist() == [[True, True, False], [True, False, False]]
    assert draft.text() == "██· · \n████· "
    assert Matrix(rows=["...", "#.."]).build().rolled(1, 1).rows() == [".#.", "..."]
    matrix = np.eye(3, dtype=np.bool_)
    draft = Draft(matrix)
    matrix[0, 0] = False
    assert draft.warp_over[0, 0]
    with pytest.raises(ValueError, match="read-only"):
        draft.warp_over[0, 0] = False
    assert pickle.loads(pickle.dumps(draft)) == draft and hash(pickle.loads(pickle.dumps(draft))) == hash(draft)


@given(matrices, st.integers(-9, 9), st.integers(-9, 9), st.integers(1, 2), st.integers(1, 2))
def test_canonical_form_ignores_shift_mirror_and_repetition(matrix, ends, picks, times_x, times_y):
    draft = Draft(matrix)
    rolled = draft.rolled(ends, picks)
    same = Draft(np.tile(rolled.warp_over[::-1], (times_y, times_x)))
    assert same.canonical() == draft.canonical()


def test_canonical_form_tells_cloths_apart_and_is_that_of_a_loom_tied_up_for_a_twill():
    weaves = [Plain(), Twill(over=2, under=2), Twill(over=3, under=1), Twill(over=1, under=3)]
    assert len({weave.build().canonical() for weave in weaves}) == 4
    tie_up = [[1, 1, 0, 0], [0, 1, 1, 0], [0, 0, 1, 1], [1, 0, 0, 1]]
    woven = Loom(threading=[1, 2, 3, 4], tie_up=tie_up, treadling=[1, 2, 3, 4]).build()
    assert woven.canonical() == Twill(over=2, under=2).build().canonical()


@pytest.mark.parametrize("shape", [(0, 3), (3, 0), (LARGEST_REPEAT + 1, 2), (4,), (2, 2, 2)])
def test_shapes_that_are_no_repeat_are_refused(shape):
    refusal(Draft, np.zeros(shape, dtype=np.bool_))


@given(st.lists(st.text(alphabet="#.x", max_size=4), max_size=4))
def test_any_drawing_is_woven_or_refused(rows):
    try:
        assert Matrix(rows=rows).build().rows() == rows
    except ValidationError:
        assert not rows or not rows[0] or len({*map(len, rows)}) > 1 or "x" in "".join(rows)


def test_different_cells_are_those_no_translation_carries_into_another():
    """One cell, plain, plain drawn twice, a twill, a single point, and a basket."""
    drawings = ["#", "#. .#", "#.#. .#.# #.#. .#.#", "#... .#.. ..#. ...#", "#.. ... ...", "##.. ##.. ..## ..##"]
    assert [Matrix(rows=drawing.split()).build().different_cells() for drawing in drawings] == [1, 2, 2, 4, 9, 8]
