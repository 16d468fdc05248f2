import math

import numpy as np
import pytest

from pipeline.truth.cloth import cloth_side
from pipeline.truth.geometry.heightfield import UNDER, surface_at
from pipeline.truth.geometry.march import first_cell, level_ray, next_cell, span_on_top, wrap
from pipeline.truth.options import TruthOptions
from tests.pipeline.truth.cloths import woven
from weaves.fabric import load_fabric

FIELD = cloth_side(load_fabric("cotton_twill"), TruthOptions()).front


def test_rays_enter_the_cells_of_their_points_and_pass_over_the_top_yarn_where_it_shows():
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
    # Points just inside both ends lie on the top yarn; points just outside do not.
    field = cloth_side(woven("cotton_twill", width=0.6), TruthOptions()).front
    random, tested = np.random.default_rng(4), 0
    for _ in range(300):
        end, pick = random.integers(0, field.top.shape[1]), random.integers(0, field.top.shape[0])
        x, y, turn = end + random.random(), pick + random.random(), random.random()
        dx, dy = math.cos(2 * math.pi * turn), math.sin(2 * math.pi * turn)
        towards = level_ray(dx, dy, 0.0)
        cell = first_cell(x, y, towards)
        leave = min(cell.next_x, cell.next_y)
        enter, exit_ = span_on_top(field, cell, x, y, towards, 0.0, leave)
        assert 0.0 <= enter <= exit_ <= leave
        for s in (enter - 1e-6, enter + 1e-6, exit_ - 1e-6, exit_ + 1e-6):
            if 0.0 < s < leave and exit_ - enter > 1e-5:
                _, side, *_ = surface_at(field, x + s * dx, y + s * dy, end, pick)
                assert (side != UNDER) == (enter < s < exit_)
                tested += 1
    assert tested > 200
