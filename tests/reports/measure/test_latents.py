import time

import pytest
import torch

from pipeline.models.woven import WovenOptions
from pipeline.models.woven.model import Woven, WovenNetwork
from pipeline.shards.queries import QueryOptions
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from reports.measure.latents import SHARES, between, measure_edits, measure_paths, pairs
from tests.pipeline.models.stand_ins import FakeMethod
from weaves.fabric import Fabric, load_fabric

pytestmark = pytest.mark.usefixtures("coarse_truth")

TRUTH = TruthOptions(estimator="node_table")
ASKED = QueryOptions(sigma=(0.3, 1.0), max_angle=60.0)


class Truth(FakeMethod):
    """Blends the truths of both ends; encoding anew asks the truth itself."""

    def predict(self, fabric, queries, seed=0):
        return estimate(fabric, queries, TRUTH, seed).mean

    def predict_between(self, first, second, share, queries):
        return (1 - share) * self.predict(first, queries) + share * self.predict(second, queries)


class Slow(FakeMethod):
    """Takes 3 ms to prepare a fabric that differs in more than its colours, and counts."""

    def prepare(self, fabric):
        if fabric.optics() not in self.asked:
            self.asked.append(fabric.optics())
            time.sleep(3e-3)


@pytest.fixture(scope="module")
def measured():
    yarns, *_, draft = pairs()
    return [record for pair in (yarns, draft) for record in measure_paths(Truth(), pair, ASKED, TRUTH, rows=128)]


def test_pairs_differ_in_one_thing_and_between_are_the_numbers_in_between():
    chosen = pairs()
    assert {pair.about for pair in chosen} == {f"{pair.differs} of {pair.second.name}" for pair in chosen}
    assert {pair.differs for pair in chosen} == {"yarns", "draft"}
    for pair in chosen:
        assert pair.first.weave.repeat == pair.second.weave.repeat
        assert (pair.first.weave == pair.second.weave) == (pair.differs == "yarns")
        same = (pair.first.warp, pair.first.weft) == (pair.second.warp, pair.second.weft)
        assert same == (pair.differs == "draft") and Fabric.model_validate(between(pair, 0.5).model_dump())
    pair = pairs()[0]
    assert between(pair, 0.0).optics() == pair.first.optics() and between(pair, 1.0).optics() == pair.second.optics()
    quarter = between(pair, 0.25)
    for name in ("bend", "twist", "roughness"):
        ends = getattr(pair.first.warp, name), getattr(pair.second.warp, name)
        assert getattr(quarter.warp, name) == pytest.approx(0.75 * ends[0] + 0.25 * ends[1])
    assert quarter.warp.diffuse == pair.first.warp.diffuse


def test_the_truth_has_no_error_where_it_is_the_truth(measured):
    """Encoded anew the truth is exact everywhere; blended at both ends of yarns, and everywhere between drafts.

    Answers are no linear function of roughness and bend: the blend of answers errs most in the middle."""
    curves = {(record.metric, record.note): record for record in measured}
    assert len(curves) == len(measured) == 3 and ("reencode_error", "draft of denim") not in curves
    anew, blended = (dict(curves[metric, "yarns of satin_8"].curve) for metric in ("reencode_error", "path_error"))
    assert list(anew) == list(SHARES) and set(anew.values()) == {blended[0.0], blended[1.0]} == {0.0}
    assert set(dict(curves["path_error", "draft of denim"].curve).values()) == {0.0}
    assert curves["path_error", "yarns of satin_8"].value == blended[0.5] == max(blended.values()) > 0.02


def test_edits_of_a_yarn_are_waited_for_and_a_network_is_measured():
    method = Slow()
    yarn, colour = measure_edits(method, load_fabric("denim"), repeats=5)
    assert len(method.asked) == 1 + 6  # the fabric, one edit to warm up, five timed ones: none twice
    assert yarn.low <= yarn.value <= yarn.high and yarn.value >= 3.0 and yarn.unit == "ms" and yarn.count == 5
    assert colour.value < yarn.value and (yarn.note, colour.note) == ("a yarn", "a colour")
    torch.manual_seed(0)
    method = Woven(WovenNetwork(WovenOptions(map_texels=16, encoder_channels=4, hidden=16, latent=8)))
    pair = pairs()[0]
    records = [*measure_paths(method, pair, ASKED, TRUTH, rows=64), *measure_edits(method, pair.first, repeats=3)]
    assert all(value > 0 for record in records[:2] for _, value in record.curve)
    assert [record.note for record in records] == ["yarns of satin_8"] * 2 + ["a yarn", "a colour"]
