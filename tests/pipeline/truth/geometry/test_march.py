import math

import numpy as np
import pytest

from pipeline.truth.cloth import cloth_side
from pipeline.truth.geometry.march import first_cell, level_ray, next_cell, wrap
from pipeline.truth.options import TruthOptions
from weaves.fabric import load_fabric

FIELD = cloth_side(load_fabric("cotton_twill"), TruthOptions()).front


def test_rays_enter_the_cells_of_their_points():
    for x in (0.0, 2.999, 3.0, -0.25, -3.0, 1e6 + 0.5, -1e-20):
        found = wrap(x, 3.0)
        assert 0.0 <= found < 3.0
        assert math.remainder(found - x, 3.0) == pytest.approx(0.0, abs=1e-9)
    # The middle of the way through each cell lies in that cell, here and within the repeat of 3 x 5.
    for turn in (0.0, 0.07, 0.25, 0.4, 0.5, 0.61, 0.75, 0.93):
        ends, picks = 3, 5
        field = FIELD._replace(top=np.zeros((picks, ends), np.int8))
        x, y = 1.3, 4.2
        dx, dy = round(math.cos(2 * math.pi * turn), 12), round(math.sin(2 * math.pi * turn), 12)
        towards = level_ray(dx, dy, 0.0)
        cell, distance = first_cell(x, y, towards), 0.0
        for _ in range(20):
            leave = min(cell.next_x, cell.next_y)
            middle = 0.5 * (distance + leave)
            column, row = math.floor(x + middle * dx), math.floor(y + middle * dy)
            assert (cell.column, cell.row) == (column, row)
            assert (cell.end, cell.pick) == (column % ends, row % picks)
            cell, distance = next_cell(field, cell, towards), leave
