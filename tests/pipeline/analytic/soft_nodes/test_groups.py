"""Kinds hold every piece once, and stay few."""

import numpy as np
import pytest

from pipeline.analytic.soft_nodes.detail import DETAILS, USUAL
from pipeline.analytic.soft_nodes.groups import gather
from pipeline.truth.geometry.heightfield import TOP, height_field
from pipeline.truth.geometry.pieces import cell_pieces
from weaves.draft import Matrix
from weaves.fabric import load_fabric


def irregular(side):
    random = np.random.default_rng(3)
    rows = tuple("".join("#" if over else "." for over in row) for row in random.random((side, side)) < 0.5)
    return load_fabric("polyester_lining").model_copy(update={"draft": Matrix(rows=rows)})


def placed(fabric):
    field = height_field(fabric)
    cells = [(end, pick) for pick, end in np.ndindex(*field.top.shape)]
    return [(cell, piece, 0) for cell in cells for piece in cell_pieces(field, cell[1], cell[0])]


@pytest.mark.parametrize(("name", "groups"), [("polyester_lining", 2), ("cotton_twill", 4), ("satin_8", 8)])
def test_regular_weaves_have_few_groups(name, groups):
    assert len(gather(placed(load_fabric(name)), DETAILS[USUAL])) == groups


@pytest.mark.parametrize("level", DETAILS)
@pytest.mark.parametrize("side", [8, 16])
def test_many_different_floats_are_merged_and_no_cell_is_lost(side, level):
    pieces, detail = placed(irregular(side)), DETAILS[level]
    groups = gather(pieces, detail)
    nodes = [group.nodes for group in groups if group.piece.side == TOP]
    # Pieces that differ across are not merged: one group of each is left.
    assert sum(nodes) <= max(detail.most, 2 * detail.parts * max(nodes))
    cells = sorted(cell for cell, _, _ in pieces for _ in range(detail.parts))
    assert sorted(cell for group in groups for cell in group.cells) == cells

    # What is merged keeps the mean inclination of its cells.
    for family in (0, 1):
        own = [piece for _, piece, _ in pieces if piece.family == family]
        expected = np.mean([piece.offset * piece.curve for piece in own])
        merged = [group for group in groups if group.piece.family == family]
        found = sum(len(group.cells) * group.piece.offset * group.piece.curve for group in merged)
        found /= detail.parts * len(own)
        assert found == pytest.approx(expected, abs=1e-9)
