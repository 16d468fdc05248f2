import numpy as np
import pytest

from pipeline.models.unified_btf.angular_samples import angular_samples, draw_samples
from pipeline.models.unified_btf.options import UnifiedBtfOptions
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from weaves.fabric import load_fabric

SMALL = UnifiedBtfOptions(texels_per_yarn=2, samples=4, fewest_samples=2)


def test_samples_are_the_truth_at_the_texels():
    """Texel (row, column) lies at v = row, u = column: on a 6 x 8 repeat no mistake of order can hide."""
    shantung = load_fabric("silk_shantung")
    exact = TruthOptions(estimator="owen", min_count=4096, max_count=4096)
    samples = draw_samples(shantung, SMALL.model_copy(update={"truth": exact, "samples": 1}))
    assert samples.shape == (2 * shantung.weave.repeat[1], 2 * shantung.weave.repeat[0])
    row, column = 3, 9
    u, v, sigma = (np.float32([x]) for x in (column / 2 + 0.25, row / 2 + 0.25, 0.25))
    answer = estimate(shantung, Queries.round(u, v, sigma, samples.wi[:1], samples.wo[:1]), exact, 7)
    found = samples.values[0, row * samples.shape[1] + column]
    assert np.abs(found - answer.mean[0]).max() < 5 * answer.standard_error.max() + 1e-3 * answer.mean.max()
    assert np.ptp(samples.values[0], axis=0).max() > 0.1 * answer.mean.max()


def test_more_samples_begin_with_the_same_ones():
    lining = load_fabric("polyester_lining")
    few, many = (draw_samples(lining, SMALL.model_copy(update={"samples": count})) for count in (4, 9))
    np.testing.assert_array_equal(many.values[:4], few.values)
    np.testing.assert_array_equal(many.wi[:4], few.wi)
    assert len(np.unique(many.wi, axis=0)) == 9


def test_every_fabric_is_seen_under_its_own_directions():
    lining, basket = (draw_samples(load_fabric(name), SMALL) for name in ("polyester_lining", "basket"))
    assert not np.isin(lining.wi, basket.wi).any()


def test_samples_in_use_are_not_drawn_again():
    lining = load_fabric("polyester_lining")
    held = angular_samples(lining, SMALL)
    assert angular_samples(lining.model_copy(update={"name": "other"}), SMALL) is held
    assert angular_samples(lining, SMALL.model_copy(update={"latent": 4})) is held
    assert angular_samples(lining, SMALL.model_copy(update={"max_angle": 60.0})) is not held


@pytest.mark.parametrize("change", [{"samples": 3, "fewest_samples": 4}, {"texel_sigma": 0.0}, {"samples": 0}])
def test_impossible_samples_are_refused(change):
    with pytest.raises(ValueError, match=r"samples|texel_sigma"):
        UnifiedBtfOptions.model_validate(change)
