import numpy as np
import pytest
import torch

from pipeline.fingerprint import fingerprint
from pipeline.models.neumip import NeumipOptions
from pipeline.models.neumip.model import Neumip, NeumipNetwork
from pipeline.truth.query import Queries
from weaves.fabric import load_fabric

SMALL = NeumipOptions(texels_per_yarn=4)


def test_footprint_chooses_the_levels():
    """sigma_0 = half a finest texel reads level 0, twice it level 1, the geometric mean both equally."""
    network = NeumipNetwork(SMALL.model_copy(update={"offset": False}), (2, 2)).eval()
    for index, level in enumerate(network.levels):
        level.data.fill_(float(index))
    sigma = 0.5 / 4 * torch.tensor([0.01, 1.0, 2.0**0.5, 2.0, 1e6])
    zero = torch.zeros(5)
    read = network.read(list(network.levels), zero, zero, sigma)[:, 0]
    torch.testing.assert_close(read, torch.tensor([0.0, 0.0, 0.5, 1.0, len(network.levels) - 1.0]))


def test_blur_halves_and_the_offset_freezes():
    network = NeumipNetwork(SMALL.model_copy(update={"blur": 8.0, "blur_halving": 0.1, "offset_frozen": 0.5}), (2, 2))
    network.schedule(0.2)
    assert network._blur == pytest.approx(2.0)
    assert network.depth.requires_grad
    network.schedule(0.5)
    assert not network.depth.requires_grad


def test_offset_shifts_along_the_view():
    """With the published clamp: r wo.xy / max(wo.z, 0.6), here r fixed by the perceptron's last bias."""
    network = NeumipNetwork(SMALL, (4, 1)).eval()
    seen = []
    network.read = lambda levels, u, v, sigma: seen.append((u, v)) or torch.zeros(len(u), 7)
    with torch.no_grad():
        for weight in network.offset.parameters():
            weight.zero_()
        network.offset[-1].bias.fill_(1.5)
    wo = torch.tensor([[0.6, 0.0, 0.8], [0.0, 0.96, 0.28]])
    half = torch.full((2,), 0.5)
    network(half, half, half, wo, wo)
    (u, v), depth = seen[1], 0.1 * 1.5
    torch.testing.assert_close(u, torch.tensor([0.5 + depth * 0.6 / 0.8 * 2 / 4, 0.5]))
    torch.testing.assert_close(v, torch.tensor([0.5, 0.5 + depth * 0.96 / 0.6 * 2 / 1]))


def test_textures_learn_faster():
    network = NeumipNetwork(SMALL, (2, 2))
    slow, fast = network.parameter_groups(1e-3)
    assert fast["lr"] == pytest.approx(SMALL.texture_rate * 1e-3)
    assert len(fast["params"]) == len(network.levels) + 1
    assert len(slow["params"]) + len(fast["params"]) == len(list(network.parameters()))


def test_method_knows_its_fabrics_and_answers_at_extremes():
    twill, plain = load_fabric("cotton_twill"), load_fabric("polyester_lining")
    method = Neumip({fingerprint(twill.optics()): NeumipNetwork(SMALL, twill.weave.repeat)})
    assert method.covers(twill)
    assert method.covers(twill.model_copy(update={"name": "other"}))
    assert not method.covers(plain)
    u, v, sigma = (a.ravel() for a in np.meshgrid([0.0, 4.0, 1e6, -1e6], [0.0, -1e-30, 1e6], [1e-4, 1.0, 1e4]))
    grazing = np.tile(np.float32([np.sin(np.radians(89.9)), 0.0, np.cos(np.radians(89.9))]), (len(u), 1))
    asked = Queries.round(*(column.astype(np.float32) for column in (u, v, sigma)), grazing, grazing)
    prediction = method.predict(twill, asked)
    assert prediction.shape == (len(u), 4)
    assert np.isfinite(prediction).all()
    assert (prediction >= 0).all()
    assert method.bytes_stored(twill) > 4 * 7 * 16 * 16
