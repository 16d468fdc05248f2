import numpy as np
import pytest
import torch
from scipy.stats import norm

from pipeline.models.woven import WovenOptions
from pipeline.models.woven.decoder import Decoder, encoded_size, one_blob, periodic_blob


def test_the_picture_is_seen_from_the_place_asked_about_by_blobs_of_a_gaussian():
    """Filters correlated with the picture around the repeat, read at one entry: the sum written out."""
    decoder = Decoder(WovenOptions())
    picture = torch.rand(1, 64, generator=torch.Generator().manual_seed(3))
    responses = decoder.filters(picture[:, decoder.seen_cells])[0]
    weights = decoder.filters.weight.detach().reshape(-1, 8, 8).numpy()
    around = np.roll(picture.reshape(8, 8).numpy(), (-2, -7), axis=(0, 1))  # entry (2, 7) comes to (0, 0)
    np.testing.assert_allclose(responses[2 * 8 + 7].detach(), (weights * around).sum(axis=(1, 2)), rtol=1e-5, atol=1e-6)
    # The series ends at m = 7; at the deviation 1/8 what is left out is e^{-2 pi^2} = 3e-9.
    x, deviation = torch.rand(16, dtype=torch.float64), 1 / 8
    edges = np.linspace(0, 1, 9)
    images = [np.diff(norm.cdf(edges + k, loc=x[:, None], scale=deviation), axis=-1) for k in range(-3, 4)]
    np.testing.assert_allclose(periodic_blob(x, deviation, 8), np.sum(images, axis=0), atol=1e-8)
    # Every number has its own width.
    deviations = torch.tensor([0.1, 0.2, 0.3], dtype=torch.float64)
    alone = [periodic_blob(number, float(width), 8) for number, width in zip(x[:3], deviations, strict=True)]
    torch.testing.assert_close(periodic_blob(x[:3], deviations, 8), torch.stack(alone))
    # Half of it is lost at an edge.
    x = np.array([[0.0], [0.3], [1.0]])
    expected = np.diff(norm.cdf(np.linspace(0, 1, 9), loc=x, scale=1 / 8))
    np.testing.assert_allclose(one_blob(torch.tensor([0.0, 0.3, 1.0]), 8), expected, atol=1e-6)


@pytest.mark.parametrize("deviation", [0.05, 0.125, 0.4, 5.0, 1e20])
def test_periodic_blob_sums_to_one_and_does_not_see_whole_turns(deviation):
    x = torch.linspace(-2.0, 3.0, 1001, dtype=torch.float64)
    blob = periodic_blob(x, deviation, 8)
    torch.testing.assert_close(blob.sum(dim=-1), torch.ones_like(x), rtol=0, atol=1e-12)
    torch.testing.assert_close(periodic_blob(x.float(), deviation, 8).sum(dim=-1), torch.ones(1001), rtol=0, atol=2e-6)
    for turns in (-3, 1, 7):
        torch.testing.assert_close(periodic_blob(x + turns, deviation, 8), blob, rtol=0, atol=1e-12)


@pytest.mark.parametrize(("sigma", "expected"), [(1e-9, 0.0), (0.01, 0.0), (0.1, 0.5), (1.0, 1.0), (1e9, 1.0)])
def test_size_is_the_clamped_logarithm(sigma, expected):
    assert encoded_size(torch.tensor(sigma), 0.01, 1.0).item() == pytest.approx(expected, abs=1e-6)
