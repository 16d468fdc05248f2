import numpy as np
import pytest
from scipy import stats

from pipeline.truth.monte_carlo import conceal
from pipeline.truth.query import HIDDEN_SHARE


def _concealed(share, doubt):
    mean, error = np.array([0.1, 0.2, 0.0, 0.4, 0.5]), np.full(5, 0.01)
    return conceal(share, doubt, mean, error), mean, error


def test_a_visible_patch_keeps_its_answer_and_a_hidden_one_is_black_and_certain():
    undecided, mean, error = _concealed(0.5, 0.01)
    assert not undecided
    np.testing.assert_array_equal(mean, [0.1, 0.2, 0.0, 0.4, 0.5])
    np.testing.assert_allclose(error, 0.01, rtol=1e-12)
    for doubt in (0.0, 1e-5):
        undecided, mean, error = _concealed(0.5 * HIDDEN_SHARE, doubt)
        assert not undecided and not mean.any()
        np.testing.assert_allclose(error, 0.0, atol=1e-8)


@pytest.mark.parametrize("distance", [-2.0, -0.5, 0.0, 0.5, 2.0])
def test_an_undecided_patch_has_the_error_of_a_wrong_decision(distance):
    """Answer 0 or m with probability p of being wrong: the mean squared error is p m^2, beside the answer's own."""
    doubt = 2e-4
    undecided, mean, error = _concealed(HIDDEN_SHARE + distance * doubt, doubt)
    wrong = stats.norm.sf(abs(distance))
    own = 0.0 if distance < 0 else 0.01
    assert undecided
    assert mean.any() == (distance >= 0)
    np.testing.assert_allclose(error, np.hypot(own, np.sqrt(wrong) * np.array([0.1, 0.2, 0.0, 0.4, 0.5])), rtol=1e-9)
