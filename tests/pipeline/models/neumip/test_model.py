import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from pipeline.models.neumip.model import (
    HierarchicalNetwork,
    Inception,
    NeumipNetwork,
    TriplePlaneNetwork,
    _half_and_difference,
    octaves_of,
)
from tests.directions import sphere
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
    network = NeumipNetwork(NEUMIP, (2, 2))
    network.schedule(0.22)
    assert network._blur == pytest.approx(8.0 / 4)
    assert network.depth.requires_grad
    network.schedule(0.33)
    assert not network.depth.requires_grad
    slow, fast = network.parameter_groups(1e-3)
    assert fast["lr"] == pytest.approx(NEUMIP.texture_rate * 1e-3)
    assert len(fast["params"]) == len(network.levels) + 1
    assert len(slow["params"]) + len(fast["params"]) == len(list(network.parameters()))


def test_vectors_are_those_of_the_shortest_turn_and_planes_are_read_where_they_point():
    wi = sphere(20, 20)[200:]  # in front
    wo = np.random.default_rng(1).permutation(wi)
    half, difference = _half_and_difference(torch.from_numpy(wi), torch.from_numpy(wo))
    middle = (wi + wo) / np.linalg.norm(wi + wo, axis=1, keepdims=True)
    axes = np.cross(middle, [0.0, 0.0, 1.0])
    angles = np.arccos(middle[:, 2:]) / np.linalg.norm(axes, axis=1, keepdims=True)
    turned = Rotation.from_rotvec(axes * angles).apply(wi)
    np.testing.assert_allclose(half, middle[:, :2], atol=1e-12)
    np.testing.assert_allclose(difference, turned[:, :2], atol=1e-12)
    # A plane that holds x of its texels' centres gives x of the vector, up to the rim of the disc.
    network = TriplePlaneNetwork(SMALL["triple_plane"], (1, 1)).eval()
    seen = []
    network.decoder.register_forward_pre_hook(lambda decoder, inputs: seen.extend(inputs))
    with torch.no_grad():
        for plane in network.directions:
            plane.copy_(torch.linspace(-1.0, 1.0, plane.shape[-1]).expand_as(plane))
        u, given = torch.zeros(200), [torch.from_numpy(part.astype(np.float32)) for part in (wi, wo)]
        network(u, u, u + 1.0, *given)
    np.testing.assert_allclose(seen[0][:, 7], half[:, 0], atol=1e-6)
    np.testing.assert_allclose(seen[0][:, 14], difference[:, 0], atol=1e-6)


@torch.inference_mode()
def test_blocks_have_the_published_widths_and_inputs_know_their_octaves_and_repeat():
    """7 + 12 + 3 + 3 of 25 channels; the branches of one layer, 7 and 3, are one, because a query has no neighbours.

    Sines are means over the footprint: here of 20,000 places, with a standard error of .005."""
    widths = [
        [layer.out_features for layer in branch if isinstance(layer, torch.nn.Linear)]
        for branch in Inception(25).branches
    ]
    assert widths == [[10], [12, 12], [3, 3]]
    x = torch.tensor([[0.3, -0.7]])
    expected = [function(2.0**i * v) for function in (np.sin, np.cos) for v in (0.3, -0.7) for i in range(3)]
    torch.testing.assert_close(octaves_of(x, 3), torch.tensor([expected], dtype=torch.float32))
    normal = torch.randn(20_000, 1, generator=torch.Generator().manual_seed(0))
    means = octaves_of(0.3 + 0.4 * normal, 3).mean(dim=0, keepdim=True)
    torch.testing.assert_close(octaves_of(torch.tensor([[0.3]]), 3, torch.tensor([[0.4]])), means, atol=0.025, rtol=0.0)
    network = HierarchicalNetwork(SMALL["hierarchical"], (2, 2)).eval()
    assert network.decoder[0].in_features == 7 + 2 * 27 + 40
    wi, wo = (torch.from_numpy(sphere(20, 20)[rows].astype(np.float32)) for rows in (slice(300, 340), slice(340, 380)))
    u, v = torch.rand(2, 40, generator=torch.Generator().manual_seed(0))
    answers = network(u, v, u + 0.1, wi, wo)
    torch.testing.assert_close(network(u + 1.0, v - 2.0, u + 0.1, wi, wo), answers, atol=1e-3, rtol=1e-3)
    assert float((network(u + 0.5, v, u + 0.1, wi, wo) - answers).abs().max()) > 0.01
