import math

import numpy as np
import pytest

from pipeline.truth.cloth import cloth_side
from pipeline.truth.geometry.heightfield import height_field, surface_at
from pipeline.truth.geometry.pieces import (
    cell_pieces,
    different_cells,
    first_cells,
    lattice,
    longest_period,
    orbits,
    translations,
)
from pipeline.truth.options import TruthOptions
from tests.pipeline.truth.cloths import woven
from weaves.fabric import load_fabric


@pytest.mark.parametrize(("warp", "weft"), [(1.0, 1.0), (0.7, 1.0), (1.0, 0.6), (0.8, 0.3)])
def test_every_point_of_a_cell_lies_in_one_piece_which_shows_the_yarn_seen_there(warp, weft):
    field = height_field(woven("cotton_twill", None, {"width": warp}, {"width": weft}))
    x, y = np.random.default_rng(1).random((2, 300))
    for pick, end in ((0, 0), (1, 0), (2, 3)):
        inside = np.zeros(300, int)
        for piece in cell_pieces(field, pick, end):
            (x_low, x_high), (y_low, y_high) = piece.box
            inside += (x >= x_low) & (x < x_high) & (y >= y_low) & (y < y_high)
            at = 0.3 * x_low + 0.7 * x_high, 0.3 * y_low + 0.7 * y_high
            family, side, *_ = surface_at(field, end + at[0], pick + at[1], end, pick)
            assert family == piece.family and (piece.radius == 0.0 or side == piece.side)
        np.testing.assert_array_equal(inside, 1)


def _front(name):
    return cloth_side(load_fabric(name), TruthOptions()).front


@pytest.mark.parametrize(
    ("name", "cells"),
    [("polyester_lining", 2), ("cotton_twill", 4), ("satin_8", 8), ("silk_charmeuse", 5), ("basket", 8)],
)
def test_each_orbit_holds_every_translation_of_its_first_cell(name, cells):
    field = _front(name)
    found = orbits(field)
    assert len(found) == different_cells(field) == first_cells(field).sum() == cells
    assert sorted(cell for orbit in found for cell in orbit) == list(np.ndindex(field.top.shape))
    for orbit in found:
        assert len({field.top[cell] for cell in orbit}) == 1
        assert orbit[0] == min(orbit) and first_cells(field)[orbit[0]]


def test_longest_period_of_a_plain_weave_is_its_diagonal():
    """A checkerboard has no wave slower than (1/2, 1/2) periods a yarn."""
    assert longest_period(_front("polyester_lining")) == pytest.approx(math.sqrt(2.0))


@pytest.mark.parametrize("name", ["satin_8", "denim", "polyester_lining", "silk_shantung", "herringbone"])
def test_a_lattice_has_all_translations_and_no_others(name):
    field = height_field(load_fabric(name))
    (picks, ends), (length, height, shift) = field.top.shape, lattice(field)
    found = {
        (row * height % picks, (row * shift + column * length) % ends) for row in range(picks) for column in range(ends)
    }
    assert found == set(translations(field))
    assert length * height * len(found) == picks * ends
