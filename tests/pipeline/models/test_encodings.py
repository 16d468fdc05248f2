import math

import numpy as np
import pytest
import torch

from pipeline.models.encodings import encoded_size, one_blob


def test_periodic_blob_always_sums_to_one():
    x = torch.linspace(-2.0, 3.0, 1001)
    torch.testing.assert_close(one_blob(x, 8, periodic=True).sum(dim=-1), torch.ones(1001), rtol=0, atol=2e-6)


def test_periodic_blob_does_not_see_whole_turns():
    x = torch.rand(256, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    for turns in (-3, 1, 7):
        torch.testing.assert_close(one_blob(x + turns, 8, True), one_blob(x, 8, True), rtol=0, atol=1e-12)


def test_periodic_blob_turns_with_its_argument():
    """Moving x by one bin moves the code by one bin, around the edge too."""
    x = torch.rand(256, generator=torch.Generator().manual_seed(2), dtype=torch.float64)
    moved = one_blob(x + 1 / 8, 8, True)
    # The Gaussian is cut at half a turn, four standard deviations: 6e-5 of it is on the other side.
    torch.testing.assert_close(moved, one_blob(x, 8, True).roll(1, dims=-1), rtol=0, atol=1e-4)


def test_plain_blob_holds_the_integral_of_a_gaussian_over_each_bin():
    from scipy.stats import norm

    x, bins = 0.3, 8
    edges = np.linspace(0, 1, bins + 1)
    expected = np.diff(norm.cdf(edges, loc=x, scale=1 / bins))
    np.testing.assert_allclose(one_blob(torch.tensor([x]), bins, False)[0], expected, atol=1e-6)


def test_plain_blob_loses_half_at_an_edge():
    torch.testing.assert_close(one_blob(torch.tensor([0.0, 1.0]), 8, False).sum(-1), torch.full((2,), 0.5))


def test_plain_and_periodic_agree_far_from_the_edges():
    x = torch.tensor([0.5])
    torch.testing.assert_close(one_blob(x, 8, False), one_blob(x, 8, True), rtol=0, atol=1e-4)


@pytest.mark.parametrize(("sigma", "expected"), [(1e-9, 0.0), (0.01, 0.0), (0.1, 0.5), (1.0, 1.0), (1e9, 1.0)])
def test_size_is_the_clamped_logarithm(sigma, expected):
    assert encoded_size(torch.tensor(sigma), 0.01, 1.0).item() == pytest.approx(expected, abs=1e-6)


def test_size_grows_by_equal_steps_for_equal_ratios():
    sizes = encoded_size(torch.tensor([0.02, 0.04, 0.08]), 0.01, 1.0)
    assert sizes.diff().numpy() == pytest.approx(math.log10(2) / 2, abs=1e-6)
