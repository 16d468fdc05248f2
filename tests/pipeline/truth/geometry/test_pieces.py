"""Pieces tile their cells, and each names the yarn that is seen there."""

import numpy as np
import pytest

from pipeline.truth.geometry.heightfield import height_field, surface_at
from pipeline.truth.geometry.pieces import cell_pieces
from weaves.fabric import load_fabric


def narrow(name, warp, weft):
    fabric = load_fabric(name)
    widths = (("warp", warp), ("weft", weft))
    return fabric.model_copy(
        update={key: getattr(fabric, key).model_copy(update={"width": width}) for key, width in widths}
    )


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


@pytest.mark.parametrize(("warp", "weft"), [(1.0, 0.6), (0.8, 0.3)])
def test_a_piece_shows_the_yarn_that_is_seen_there(warp, weft):
    field = height_field(narrow("cotton_twill", warp, weft))
    for pick, end in ((0, 0), (1, 0), (2, 3)):
        for piece in cell_pieces(field, pick, end):
            x, y = (0.3 * low + 0.7 * high for low, high in piece.box)
            family, side, *_ = surface_at(field, end + x, pick + y, end, pick)
            assert family == piece.family
            assert piece.radius == 0.0 or side == piece.side
