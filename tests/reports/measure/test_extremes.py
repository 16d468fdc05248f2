import math

import numpy as np
import pytest
import torch

from pipeline.fingerprint import fingerprint
from pipeline.models.analytic.prefiltered import PrefilteredOptions
from pipeline.models.analytic.soft_nodes import SoftNodesOptions
from pipeline.models.neumip.model import Neumip, NeumipNetwork
from pipeline.models.registry import load_methods
from pipeline.models.runtimes import runs
from pipeline.models.woven import WovenOptions
from pipeline.models.woven.model import Woven, WovenNetwork
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import LOWEST_VIEWER, faults
from reports.measure.extremes import FAR, FOOTPRINTS, extremes, lustrous, measure_extremes
from reports.options import EXTREME_PRECISIONS
from tests.pipeline.models.stand_ins import SMALL, FakeMethod
from weaves.fabric import load_fabric

LINING = load_fabric("polyester_lining")
TWILL = load_fabric("denim")


class Scaled(FakeMethod):
    """A coarse truth times a factor, but for what `spoil` does to it."""

    truth = TruthOptions(estimator="owen", parallax=False, min_count=32, max_count=32)

    def __init__(self, factor=1.0, setting="", spoil=lambda answers, queries: answers):
        self.factor, self.setting, self.spoil = factor, setting, spoil

    def covers(self, fabric):
        return fabric.name != TWILL.name

    def predict(self, fabric, queries, seed=0):
        ends, picks = fabric.weave.repeat
        near = queries._replace(u=np.mod(queries.u, ends), v=np.mod(queries.v, picks))
        return self.spoil(self.factor * estimate(fabric, near, self.truth, 0).mean, queries)


def measured(*family):
    records = measure_extremes([family], [(LINING, "seen"), (TWILL, "unseen")], Scaled.truth)
    return {(r.setting, r.metric): r for r in records}


@pytest.mark.parametrize("repeat", [(2, 2), (4, 4), (8, 5), (16, 16)])
def test_far_places_are_the_same_places_to_the_last_bit(repeat):
    asked = extremes(repeat)
    assert not faults(asked.queries) and not faults(asked.far)
    for near, far, period in ((asked.queries.u, asked.far.u, repeat[0]), (asked.queries.v, asked.far.v, repeat[1])):
        np.testing.assert_array_equal(np.mod(far.astype(np.float64), period), near)
        assert far.min() > 0.99 * FAR
    area = asked.queries.sigma.astype(np.float64) ** 2 / math.prod(repeat)
    np.testing.assert_allclose(np.sqrt(area), asked.size, rtol=1e-6)
    assert {math.degrees(math.acos(z)) > 89.8 for z in asked.queries.wi[~asked.grazing, 2]} == {False}


def test_closed_forms_and_places_and_sizes_that_change_the_answer():
    """The truth itself; 1.1 times the truth, 10 % wrong everywhere; and what that one is from the first."""
    found = measured(Scaled(), Scaled(1.1, "brighter"))
    assert found["", "extreme_error"].value == 0.0 and found["", "extreme_grazing"].value == 0.0
    assert ("", "extreme_rounding") not in found
    for metric in ("extreme_error", "extreme_grazing", "extreme_rounding"):
        assert found["brighter", metric].value == pytest.approx(0.1, rel=1e-5)
    assert [size for size, _ in found["brighter", "extreme_error"].curve] == list(FOOTPRINTS)
    assert [error for _, error in found["brighter", "extreme_error"].curve] == pytest.approx([0.1] * 5, rel=1e-5)
    for metric in ("extreme_far", "extreme_not_finite", "extreme_negative"):
        assert found["", metric].value == 0.0
    assert {record.fabric for record in found.values()} == {LINING.name}, "what is not covered is not asked"
    drift = Scaled(spoil=lambda answers, queries: answers * np.float32(1.0 + 1e-7 * queries.u[:, None]))
    assert measured(drift)["", "extreme_far"].value == pytest.approx(0.1, rel=0.01)
    shrink = Scaled(spoil=lambda answers, queries: answers * np.where(queries.sigma > 1e4, 0.75, 1.0)[:, None])
    found = measured(shrink)
    assert found["", "extreme_far"].value == 0.0 and found["", "extreme_large"].value == pytest.approx(0.25, rel=0.02)
    found = measured(Scaled(spoil=spoilt))
    # Near and far: 18 queries a footprint, each twice.
    assert found["", "extreme_not_finite"].value == 2 * 2 * 18 and found["", "extreme_negative"].value == 2 * 18
    assert [size for size, _ in found["", "extreme_error"].curve] == [1e-2, 1.0, 1e4]
    assert ("", "extreme_large") not in found, "no pair is finite"


def test_viewers_too_low_for_parallax_have_no_truth(monkeypatch):
    """They are answered, and not compared; lights that graze are."""
    monkeypatch.setattr(Scaled, "truth", TruthOptions(estimator="owen", min_count=32, max_count=32))

    def predict(method, fabric, queries, seed=0):
        low = queries.wo[:, 2] < LOWEST_VIEWER
        answers = np.full((len(low), 4), 7.0, np.float32)
        answers[~low] = 1.1 * estimate(fabric, queries.take(~low), method.truth, 0).mean
        return answers

    monkeypatch.setattr(Scaled, "predict", predict)
    found = measured(Scaled())
    for metric in ("extreme_error", "extreme_grazing"):
        assert found["", metric].value == pytest.approx(0.1, rel=1e-5)


def spoilt(answers, queries):
    answers[queries.sigma < 1e-3] = np.nan
    answers[queries.sigma > 1e4, 2] = -1.0
    answers[(queries.sigma > 100) & (queries.sigma < 1e3), 0] = np.inf
    return answers


@pytest.mark.parametrize("cloth", [LINING, lustrous(TWILL)], ids=lambda fabric: fabric.name)
def test_no_method_answers_what_cannot_be_in_any_precision(cloth):
    """Finite, never negative, a million yarns away exactly the same, and beyond a hundred repeats the average."""
    torch.manual_seed(0)
    methods = [Woven(WovenNetwork(WovenOptions(map_texels=16)))]
    methods += [Neumip({fingerprint(cloth.optics()): NeumipNetwork(SMALL["neumip"], cloth.weave.repeat)})]
    methods += [*load_methods(SoftNodesOptions()), *load_methods(PrefilteredOptions())]
    families = [[one, *runs(one, EXTREME_PRECISIONS)] for one in methods]
    values, curves = {}, {}
    for record in measure_extremes(families, [(cloth, "seen")]):
        values.setdefault(record.metric, {})[record.method, record.setting] = record.value
        curves.setdefault((record.method, record.metric), dict(record.curve))
    for metric in ("extreme_not_finite", "extreme_negative", "extreme_far"):
        assert [*values[metric].values()] == [0.0] * 12, metric
    # Encoded sizes end at one repeat, sums at the even average; half precision may round the other way.
    assert len(values["extreme_large"]) == 12 and max(values["extreme_large"].values()) < 1e-3
    half = values["extreme_rounding"]
    for name in ("neumip", "woven"):
        assert half[name, "eager-fp16"] < half[name, "eager-bf16"] < 2e-2
    if cloth is LINING:
        assert curves["soft_nodes", "extreme_error"][1e4] < 0.05
