import numpy as np
import pytest
import torch

from pipeline.models.woven.decoder import Decoder
from pipeline.models.woven.options import WovenOptions


def parameters(options: WovenOptions) -> int:
    return sum(weight.numel() for weight in Decoder(options).parameters())


@pytest.mark.parametrize("one_blob", ["plain", "periodic"])
def test_decoder_has_the_published_number_of_parameters(one_blob):
    assert parameters(WovenOptions(one_blob=one_blob)) == 86_660


def test_fusion_can_be_left_out():
    layers = (64 + 24 + 5 + 1) * 128, 2 * (128 + 1) * 128, (128 + 1) * 64, (64 + 1) * 4
    assert parameters(WovenOptions(one_blob="periodic", spatial_fusion=False)) == sum(layers)


def test_without_one_blobs_three_numbers_tell_the_place():
    """Of the published decoder the first layer alone changes: 3 numbers enter it in place of 24."""
    assert parameters(WovenOptions(one_blob="none")) == 86_660 - 21 * 128


def test_the_picture_is_seen_from_the_place_asked_about():
    """Filters correlated with the picture around the repeat, read at one entry: the sum written out."""
    torch.manual_seed(0)
    decoder = Decoder(WovenOptions())
    picture = torch.rand(1, 64, generator=torch.Generator().manual_seed(3))
    responses = decoder.filters(picture[:, decoder.seen])[0]
    weights = decoder.filters.weight.detach().reshape(-1, 8, 8).numpy()
    around = np.roll(picture.reshape(8, 8).numpy(), (-2, -7), axis=(0, 1))  # entry (2, 7) comes to (0, 0)
    np.testing.assert_allclose(responses[2 * 8 + 7].detach(), (weights * around).sum(axis=(1, 2)), rtol=1e-5, atol=1e-6)
