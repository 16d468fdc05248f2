"""Pieces tile their cells; kinds hold every piece once, and stay few."""

import numpy as np
import pytest

from pipeline.truth.heightfield import TOP, height_field
from pipeline.truth.sums.pieces import MOST_NODES, cell_pieces, gather
from weaves.draft import Matrix
from weaves.fabric import load_fabric


def narrow(name, warp, weft):
    fabric = load_fabric(name)
    widths = (("warp", warp), ("weft", weft))
    return fabric.model_copy(
        update={key: getattr(fabric, key).model_copy(update={"width": width}) for key, width in widths}
    )


def irregular(side):
    random = np.random.default_rng(3)
    rows = tuple("".join("#" if over else "." for over in row) for row in random.random((side, side)) < 0.5)
    return load_fabric("polyester_lining").model_copy(update={"draft": Matrix(rows=rows)})


def placed(fabric):
    field = height_field(fabric)
    cells = [(end, pick) for pick, end in np.ndindex(*field.top.shape)]
    return [(cell, piece, 0) for cell in cells for piece in cell_pieces(field, cell[1], cell[0])]


@pytest.mark.parametrize(("warp", "weft"), [(1.0, 1.0), (0.7, 1.0), (1.0, 0.6), (0.8, 0.3)])
def test_every_point_of_a_cell_lies_in_one_piece(warp, weft):
    field = height_field(narrow("cotton_twill", warp, weft))
    x, y = np.random.default_rng(1).random((2, 300))
    for pick, end in ((0, 0), (1, 0), (2, 3)):
        inside = np.zeros(300, int)
        for piece in cell_pieces(field, pick, end):
            (x_low, x_high), (y_low, y_high) = piece.box
            inside += (x >= x_low) & (x < x_high) & (y >= y_low) & (y < y_high)
        np.testing.assert_array_equal(inside, 1)


@pytest.mark.parametrize(("name", "kinds"), [("polyester_lining", 2), ("cotton_twill", 4), ("satin_8", 8)])
def test_regular_weaves_have_few_kinds(name, kinds):
    assert len(gather(placed(load_fabric(name)))) == kinds


@pytest.mark.parametrize("side", [8, 16])
def test_many_different_floats_are_merged_and_no_cell_is_lost(side):
    pieces = placed(irregular(side))
    kinds = gather(pieces)
    assert sum(kind.nodes for kind in kinds if kind.piece.side == TOP) <= MOST_NODES[TOP]
    assert sorted(cell for kind in kinds for cell in kind.cells) == sorted(cell for cell, _, _ in pieces)

    # What is merged keeps the mean inclination of its cells.
    for family in (0, 1):
        own = [piece for _, piece, _ in pieces if piece.family == family]
        expected = np.mean([piece.offset * piece.curve for piece in own])
        merged = [kind for kind in kinds if kind.piece.family == family]
        found = sum(len(kind.cells) * kind.piece.offset * kind.piece.curve for kind in merged) / len(own)
        assert found == pytest.approx(expected, abs=1e-9)
