import math

import numpy as np
import pytest

from pipeline.analytic.soft_nodes.components import read_queries
from pipeline.analytic.soft_nodes.nodes import tabulate
from pipeline.models.bounded import Bounded
from pipeline.models.method import refuse_other
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from reports.measure import furnace
from reports.measure.furnace import DIRECTIONS, furnace_queries, measure_furnace
from tests.pipeline.models.stand_ins import FakeMethod
from tests.presets import slow
from weaves.fabric import load_fabric


def lambertian(queries):
    """Answer cos / pi in one component, and a constant in another."""
    cosine = queries.wi[:, 2]
    return np.stack([0 * cosine + 0.1, 0 * cosine, cosine / math.pi, 0 * cosine], axis=1)


def test_closed_forms_both_sides_add_up_and_a_method_may_know_one():
    """A white Lambertian surface returns all, f = .1 returns .2 pi; R2 with 256 points is good to half a per cent."""
    values = {record.metric: record.value for record in measure_furnace(FakeMethod(lambertian), load_fabric("denim"))}
    assert values["furnace_diffuse"] == pytest.approx(1.0, abs=5e-3)
    assert values["furnace_specular"] == pytest.approx(0.2 * math.pi, rel=1e-5)

    def front(queries):
        refuse_other(queries, "fake answers")
        return lambertian(queries)

    metrics = [record.metric for record in measure_furnace(FakeMethod(front), load_fabric("denim"))]
    assert metrics == ["furnace_diffuse", "furnace_specular", "furnace_colour"]
    queries = furnace_queries((4, 4))
    lights = queries.wi.reshape(-1, DIRECTIONS, 3)
    np.testing.assert_array_equal(lights, np.broadcast_to(lights[0], lights.shape))
    assert (queries.wo.reshape(-1, DIRECTIONS, 3) == queries.wo[::DIRECTIONS, None]).all()
    # A quarter back, a third through, diffuse; half of what is behind is seen straight: in colours of one channel.
    denim = load_fabric("denim")
    black, red = (0.0, 0.0, 0.0), (0.5, 0.0, 0.0)
    warp = denim.warp.model_copy(update={"specular": black, "diffuse": red, "diffuse_transmission": red})
    fabric = denim.model_copy(update={"warp": warp})

    def both(queries):
        share = np.where(queries.wi[:, 2] > 0.0, 1 / 4, 1 / 3)
        return np.abs(queries.wi[:, 2:]) / math.pi * share[:, None] * [[0.0, 0.0, 1.0, 0.0]]

    method = FakeMethod(both)
    method.transparency = lambda fabric, looks, seed: np.full(len(looks.u), 0.5, np.float32)
    values = {record.metric: record.value for record in measure_furnace(method, fabric)}
    assert values["furnace_colour"] == pytest.approx(0.5 / 4, abs=2e-3)
    assert values["furnace_all"] == pytest.approx(0.5 / 4 + 0.5 / 3 + 0.5, abs=4e-3)


def test_the_truth_makes_no_light(monkeypatch):
    """At one place: the mean over 256 directions has a sixteenth of the error of one."""
    monkeypatch.setattr(furnace, "_PLACES", 1)
    lining, options = load_fabric("polyester_lining"), TruthOptions(relative_error=0.05)
    method = FakeMethod(lambda queries: estimate(lining, queries, options, 0).mean)
    for record in measure_furnace(method, lining):
        assert 0 < record.value <= 1.005, record.metric


@pytest.mark.parametrize("name", ["polyester_lining", slow("voile"), slow("silk_charmeuse"), slow("twill_4_4")])
def test_the_brightest_method_returns_at_most_what_arrives_and_soft_nodes_no_more(name):
    """A network gone wrong answers a thousand times too much: what is left are the soft nodes without shadows.

    At most 1 but for the error of 256 directions. Diffuse: exactly bounded. Specular, scattered once: far below. All
    that comes from both sides, in legal colours: at most 1."""
    fabric = load_fabric(name)
    bright = FakeMethod(lambda queries: np.full((len(queries.u), 4), 1e3, np.float32))
    found = {r.metric: r.value for r in measure_furnace(Bounded(bright), fabric)}
    assert found["furnace_diffuse"] <= 1.005 and found["furnace_specular"] < 0.6
    assert found["furnace_colour"] < found["furnace_all"] <= 1.005
    reading = read_queries(tabulate(fabric), furnace_queries(fabric.weave.repeat))
    assert (reading.components <= reading.bounds * 1.0001 + 1e-7).all()
