import numpy as np
import pytest

from pipeline.models.unified_btf.angular_samples import angular_samples, read_samples
from pipeline.models.unified_btf.options import UnifiedBtfOptions
from pipeline.shards.store import columns_of
from weaves.fabric import load_fabric

SMALL = UnifiedBtfOptions(texels_per_yarn=2, samples=4, fewest_samples=2)
SHANTUNG, LINING = load_fabric("silk_shantung"), load_fabric("polyester_lining")


def test_rows_become_samples_by_texels():
    """A 6 x 8 repeat, so that no mistake of order can hide; half precision rounds by 2^-11."""
    queries, answers = SMALL.angular_samples.answer(SHANTUNG, 0, SMALL.angular_samples.count(SHANTUNG))
    samples = read_samples(SHANTUNG, SMALL, columns_of(queries, answers))
    assert samples.shape == (2 * SHANTUNG.weave.repeat[1], 2 * SHANTUNG.weave.repeat[0])
    sample, row, column = 2, 3, 9
    (found,) = np.flatnonzero(
        (queries.u == column / 2 + 0.25)
        & (queries.v == row / 2 + 0.25)
        & (queries.wi == samples.wi[sample]).all(axis=1)
    )
    assert (queries.wo[found] == samples.wo[sample]).all()
    read = samples.values[sample, row * samples.shape[1] + column]
    np.testing.assert_allclose(read, answers.mean[found], rtol=2**-11, atol=2**-24)


def test_samples_in_use_are_not_computed_again():
    held = angular_samples(LINING, SMALL)
    assert angular_samples(LINING.model_copy(update={"name": "other"}), SMALL) is held
    assert angular_samples(LINING, SMALL.model_copy(update={"latent": 4})) is held
    assert angular_samples(LINING, SMALL.model_copy(update={"max_angle": 60.0})) is not held


@pytest.mark.parametrize("change", [{"samples": 3, "fewest_samples": 4}, {"texel_sigma": 0.0}, {"samples": 0}])
def test_impossible_samples_are_refused(change):
    with pytest.raises(ValueError, match=r"samples|texel_sigma"):
        UnifiedBtfOptions.model_validate(change)
