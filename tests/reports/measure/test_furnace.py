"""The white furnace: closed forms, and a truth that makes no light."""

import math

import numpy as np
import pytest

from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from reports.measure.furnace import DIRECTIONS, furnace_queries, measure_furnace
from reports.tables.summary import energy_table
from weaves.fabric import load_fabric


class Lambertian:
    """Answers cos / pi in one component, and a constant in another."""

    name, setting = "lambertian", ""

    def prepare(self, fabric):
        pass

    def predict(self, fabric, queries, seed=0):
        cosine = queries.wi[:, 2]
        zero = np.zeros_like(cosine)
        return np.stack([np.full_like(cosine, 0.1), zero, cosine / math.pi, zero], axis=1).astype(np.float32)


class Truth(Lambertian):
    """Answers by the truth's own table."""

    name = "truth"

    def predict(self, fabric, queries, seed=0):
        return estimate(fabric, queries, TruthOptions(estimator="node_table"), seed).mean


def test_closed_forms():
    """A white Lambertian surface returns all, f = .1 returns .2 pi; R2 with 256 points is good to half a per cent."""
    records = measure_furnace(Lambertian(), load_fabric("denim"), "seen")
    values = {record.metric: record.value for record in records}
    assert values["furnace_diffuse"] == pytest.approx(1.0, abs=5e-3)
    assert values["furnace_specular"] == pytest.approx(0.2 * math.pi, rel=1e-5)
    (row,) = energy_table(records).to_dict("records")
    assert row["diffuse"] == values["furnace_diffuse"] and row["fabrics"] == 1


def test_every_patch_sees_the_same_lights():
    queries = furnace_queries((4, 4))
    lights = queries.wi.reshape(-1, DIRECTIONS, 3)
    np.testing.assert_array_equal(lights, np.broadcast_to(lights[0], lights.shape))
    assert (queries.wo.reshape(-1, DIRECTIONS, 3) == queries.wo[::DIRECTIONS, None]).all()


def test_the_truth_makes_no_light():
    for record in measure_furnace(Truth(), load_fabric("polyester_lining"), "seen"):
        assert 0 < record.value <= 1.005, record.metric
