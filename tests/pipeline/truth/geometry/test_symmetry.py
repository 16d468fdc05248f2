"""Translations of a cloth: known weaves, broken symmetry, the waves that they leave."""

import math

import numpy as np
import pytest

from pipeline.truth.cloth import cloth_side
from pipeline.truth.geometry.symmetry import different_cells, first_cells, longest_period, orbits
from pipeline.truth.options import TruthOptions
from weaves.fabric import load_fabric


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
