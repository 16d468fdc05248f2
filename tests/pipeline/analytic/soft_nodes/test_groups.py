"""Kinds hold every piece once, and stay few."""

import math

import numpy as np
import pytest

from pipeline.analytic.gauss_rules import gauss_rule
from pipeline.analytic.soft_nodes.groups import DETAILS, USUAL, gather, piece_rows
from pipeline.truth.geometry.heightfield import GAP, RADIUS, TOP, WARP, height_field, surface_at
from pipeline.truth.geometry.pieces import cell_pieces
from tests.pipeline.truth.cloths import irregular, woven
from weaves.fabric import load_fabric


def placed(fabric):
    field = height_field(fabric)
    cells = [(end, pick) for pick, end in np.ndindex(*field.top.shape)]
    return [(cell, piece, 0) for cell in cells for piece in cell_pieces(field, cell[1], cell[0])]


@pytest.mark.parametrize(("name", "groups"), [("polyester_lining", 2), ("cotton_twill", 4), ("satin_8", 8)])
def test_regular_weaves_have_few_groups(name, groups):
    assert len(gather(placed(load_fabric(name)), DETAILS[USUAL])) == groups


@pytest.mark.parametrize("level", list(DETAILS)[1:])  # the first has the groups of the second
@pytest.mark.parametrize("side", [8, 16])
def test_many_different_floats_are_merged_and_no_cell_is_lost(side, level):
    pieces, detail = placed(irregular(side, seed=3)), DETAILS[level]
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


def cloth(name, width):
    return woven(name, width=width, relief=1.3, twist=25.0)


def from_fabric(family, vector):
    """Turn a fabric vector into the frame of its yarn."""
    x, y, z = vector
    return np.array([x, y, z]) if family == WARP else np.array([y, -x, z])


@pytest.mark.parametrize(("name", "width"), [("cotton_twill", 1.0), ("cotton_twill", 0.7), ("silk_charmeuse", 0.8)])
def test_nodes_lie_on_the_cloth(name, width):
    field = height_field(cloth(name, width))
    checked = set()
    for pick, end in np.ndindex(2, 3):
        for piece in cell_pieces(field, pick, end):
            if piece.family == GAP:
                continue
            radius = field.yarn[piece.family, RADIUS]
            across, along = gauss_rule(*piece.across, 8, radius), gauss_rule(*piece.along, 3, 0.0)
            rows = piece_rows(field.yarn, piece, across, along)
            for node in range(0, 24, 5):
                a, b = across.places[node % 8], along.places[node // 8]
                x, y = (a, b) if piece.family == WARP else (b, a)
                family, side, _, *vectors = surface_at(field, end + x, pick + y, end, pick)
                assert (family, side) == (piece.family, piece.side)
                np.testing.assert_allclose(rows[:3, node], from_fabric(family, vectors[:3]), atol=1e-6)
                np.testing.assert_allclose(rows[4:7, node], from_fabric(family, vectors[3:]), atol=1e-6)
            checked.add(piece.side)
    assert len(checked) == (2 if width < 1.0 else 1)


def test_the_tangents_change_is_its_derivative():
    """Central differences over a hundredth of a box; their error is of second order."""
    field = height_field(cloth("cotton_twill", 1.0))
    piece = cell_pieces(field, 0, 0)[0]
    across, along = gauss_rule(*piece.across, 8, field.yarn[piece.family, RADIUS]), gauss_rule(*piece.along, 4, 0.0)
    rows = piece_rows(field.yarn, piece, across, along)
    step = 0.005
    boxes = np.diff(along.borders)
    ahead, behind = (
        piece_rows(field.yarn, piece, across, along._replace(places=along.places + sign * step * boxes))[4:7]
        for sign in (1, -1)
    )
    # Along a weft the yarn's own y runs against the cell's axis.
    sense = 1.0 if piece.family == WARP else -1.0
    expected = sense * (ahead - behind) / (2 * step) * 0.5 / math.sqrt(3.0)
    np.testing.assert_allclose(rows[7:10], expected, atol=2e-3 * np.abs(expected).max())
