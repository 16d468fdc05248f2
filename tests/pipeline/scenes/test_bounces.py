from functools import partial
from unittest.mock import Mock

import numpy as np
import pytest

from pipeline.analytic.bounces import table
from pipeline.scenes import bounces
from pipeline.scenes.shade import colours_of, shade
from pipeline.truth.query import Queries
from tests.directions import unit
from tests.pipeline.truth.cloths import coloured, woven
from weaves.errors import BadInput

CLOTH = woven("polyester_lining", diffuse=(0.9, 0.5, 0.0))
WI, WO = (np.float32([unit(*angles) for angles in ways]) for ways in (((30, 20), (60, 140)), ((50, 250), (10, 0))))
NONE = np.zeros((2, 4))


def _queries(wi=WI, wo=WO):
    return Queries.round(np.array([0.3, 0.7]), np.array([0.2, 0.9]), np.array([0.1, 3.0]), wi, wo)


def test_all_bounces_are_added_to_the_first_and_threads_send_on_light_in_their_own_colours():
    """By default; a channel that no yarn reflects gets no light, and a white one most."""
    components, queries = np.random.default_rng(1).random((2, 4)), _queries()
    once, every = shade(CLOTH, components, queries, 1), shade(CLOTH, components, queries)
    added = every - once
    assert added == pytest.approx(shade(CLOTH, NONE, queries))
    assert (added[:, 2] == 0.0).all() and (added[:, 0] > 2.0 * added[:, 1]).all() and (added[:, 1] > 0.0).all()
    # The yarns further back have the mean colours of the cloth: light on the seen thread is that of the mean cloth.
    cloth, queries = coloured("denim", ends=[["red", 1], ["blue", 1]]), _queries()
    own, mean = colours_of(cloth, queries), colours_of(cloth.average(), queries)
    light = bounces.later_bounces(cloth.average(), queries, mean) / mean[:, 2:]
    assert bounces.later_bounces(cloth, queries, own) == pytest.approx(light * own[:, 2:])
    assert np.ptp(own[:, 2], axis=0).max() > 0.1


def test_colours_change_no_table(monkeypatch):
    make = Mock(side_effect=partial(table.bounce_table, walks=1 << 10))
    monkeypatch.setattr(bounces, "_TABLES", bounces.PerFabric(make))
    for albedo in (0.2, 0.4, 0.8):
        shade(woven("denim", diffuse=(albedo,) * 3), NONE, _queries())
    assert make.call_count == 1


def test_cloth_from_behind_is_that_of_its_back_and_what_is_transmitted_has_colours_of_its_own():
    flip = np.float32([1.0, 1.0, -1.0])
    behind = shade(CLOTH, NONE, _queries(WI * flip, WO * flip), "all")
    assert behind == pytest.approx(shade(CLOTH.back(), NONE, _queries(), "all")) and behind.max() > 0.0
    queries = _queries(WI * flip)
    assert shade(CLOTH, NONE, queries, "all").max() == 0.0
    # From behind, one channel each: without k_dt only gaps let light in; k_d makes more of what k_dt lets through.
    cloth = woven("gauze", diffuse=(0.6, 0.3, 0.6), diffuse_transmission=(0.3, 0.3, 0.0))
    light = shade(cloth, NONE, queries, "all")
    assert (light > 0.0).all() and (light[:, 0] > 1.2 * light[:, 1]).all() and (light[:, 2] < 0.5 * light[:, 0]).all()
    turned = _queries(WI, WO * np.float32([1.0, 1.0, -1.0]))
    assert light == pytest.approx(shade(cloth.back(), NONE, turned, "all"), rel=1e-6)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_sum_over_both_ways_is_that_of_the_table(side):
    """A cloth of one colour of threads: its own colours and the mean ones are the same."""
    cloth = woven("voile", diffuse=(0.6, 0.3, 0.6), diffuse_transmission=(0.3, 0.2, 0.1))
    queries = _queries(WI * np.float32([1.0, 1.0, side]))
    yarns = cloth.warp, cloth.weft
    colours = np.array([yarn.diffuse_rgb for yarn in yarns] + [yarn.diffuse_transmission_rgb for yarn in yarns])
    light = table.bounced(bounces._TABLES_THROUGH.of(cloth), queries.wi, queries.wo, colours) * colours
    found = bounces.later_bounces(cloth, queries, colours_of(cloth, queries))
    assert found == pytest.approx(light[:, :2] + light[:, 2:], rel=1e-6)


@pytest.mark.parametrize("number", [0, 2, "none"])
def test_other_numbers_of_bounces_are_refused(number):
    with pytest.raises(BadInput, match=r'bounces.*must be 1 or "all"'):
        shade(CLOTH, NONE, _queries(), number)
