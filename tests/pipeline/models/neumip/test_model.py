import pytest
import torch

from pipeline.models.neumip.model import NeumipNetwork
from tests.pipeline.models.stand_ins import SMALL

NEUMIP = SMALL["neumip"]


def test_footprint_chooses_the_levels_offset_shifts_along_the_view_and_blur_halves():
    """sigma_0 = half a finest texel reads level 0, twice it level 1, the geometric mean both equally."""
    network = NeumipNetwork(NEUMIP.model_copy(update={"offset": False}), (2, 2)).eval()
    for index, level in enumerate(network.levels):
        level.data.fill_(float(index))
    sigma = 0.5 / 4 * torch.tensor([0.01, 1.0, 2.0**0.5, 2.0, 1e6])
    zero = torch.zeros(5)
    read = network.read(list(network.levels), zero, zero, sigma)[:, 0]
    torch.testing.assert_close(read, torch.tensor([0.0, 0.0, 0.5, 1.0, len(network.levels) - 1.0]))
    # With the published clamp: r wo.xy / max(wo.z, 0.6), here r fixed by the perceptron's last bias.
    network = NeumipNetwork(NEUMIP, (4, 1)).eval()
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
    changes = {"blur": 8.0, "blur_halving": 0.1, "offset_frozen": 0.5}
    network = NeumipNetwork(NEUMIP.model_copy(update=changes), (2, 2))
    network.schedule(0.2)
    assert network._blur == pytest.approx(2.0)
    assert network.depth.requires_grad
    network.schedule(0.5)
    assert not network.depth.requires_grad
    slow, fast = network.parameter_groups(1e-3)
    assert fast["lr"] == pytest.approx(NEUMIP.texture_rate * 1e-3)
    assert len(fast["params"]) == len(network.levels) + 1
    assert len(slow["params"]) + len(fast["params"]) == len(list(network.parameters()))
