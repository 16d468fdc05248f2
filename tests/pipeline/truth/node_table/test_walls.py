"""Walls: with them every view ray meets something, and their heights are the steps of the cloth."""

import math

import numpy as np
import pytest

from pipeline.truth.cloth import cloth_side
from pipeline.truth.footprint.mixture import FINE_LINE
from pipeline.truth.node_table.answer import sum_pieces
from pipeline.truth.node_table.build import tabulate
from pipeline.truth.node_table.kernels import no_shares, node_directions
from pipeline.truth.node_table.seen_walls import sum_walls, wall_room
from pipeline.truth.node_table.weights import weight_room
from pipeline.truth.options import TruthOptions
from tests.directions import unit
from tests.pipeline.truth.cloths import cylinders, woven
from tests.presets import slow

RIMS = TruthOptions()


def _table(fabric, nodes, azimuths):
    cloth = cloth_side(fabric, RIMS)
    return cloth, tabulate(cloth.front, cloth.back, False, nodes, azimuths, rims=True)


NARROW = woven(
    "denim", ("#.##.###", ".####.##", "###.##.#", "##.####."),
    {"width": 0.68, "bend": 26.0, "relief": 0.88}, {"width": 0.66, "bend": 52.0, "relief": 0.61},
)  # fmt: skip
"""Below the sides of its floats rays leave between the yarns, over others that lie lower than the fabric plane."""


@pytest.mark.parametrize(
    ("cloth", "nodes", "azimuths"),
    [*(slow(name, 32, 128) for name in ("denim", "silk_shantung", "satin_8")), ("voile", 16, 64), (NARROW, 16, 64)],
)
def test_areas_of_nodes_and_walls_sum_to_the_cosine(cloth, nodes, azimuths):
    """Every ray meets a yarn, a wall or a gap, but one in a hundred: rims turned away, and what the back hides."""
    cloth, table = _table(woven(cloth) if isinstance(cloth, str) else cloth, nodes, azimuths)
    even, sums = no_shares(len(table.evenly))._replace(weight=table.evenly), np.zeros((3, 5))
    rooms, of_walls = (weight_room(table, FINE_LINE), wall_room(table)), []
    for degrees, azimuth in ((20.0, 10.0), (50.0, 100.0), (70.0, 215.0), (80.0, 300.0)):
        wo = unit(degrees, azimuth)
        towards = node_directions(unit(30.0, 50.0), wo, len(table.slope))
        sums[:] = 0.0
        area, *_ = sum_pieces(cloth, table, towards, even, *sums)
        walls, _ = sum_walls(cloth, table, towards, 0, *rooms, sums[0], sums[1])
        of_walls.append(walls / wo[2])
        assert (area + walls) / wo[2] == pytest.approx(1.0, abs=0.015)
    assert max(of_walls) > 0.05


def test_cylinders_side_by_side_have_no_walls_and_a_straight_one_has_the_height_of_its_step():
    _, table = _table(cylinders(), nodes=8, azimuths=8)
    assert len(table.walls.height) == 0
    # Straight warps of half the width, one spacing apart: beside each, its edge stands over the straight weft.
    _, table = _table(woven("denim", ("##", "##"), {"width": 0.5, "bend": 0.0}, {"width": 1.0, "bend": 0.0}), 8, 8)
    walls = table.walls
    assert math.isclose(float(walls.evenly.sum()), 2.0, rel_tol=1e-5)
    assert (walls.height > 0.0).all()
