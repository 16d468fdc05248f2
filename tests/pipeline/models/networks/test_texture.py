import numpy as np
import pytest
import torch

from pipeline.models.curved.model import CurvedNetwork
from pipeline.models.networks.texture import blurred, level_shapes, read_pyramid, read_texture
from pipeline.truth.query import Queries
from tests.pipeline.models.stand_ins import SMALL, batch_of, descend


def test_textures_are_read_bilinearly_wrap_halve_and_blur_as_a_gaussian():
    assert level_shapes(4, 0, (5, 2)) == [(8, 20), (4, 10), (2, 5), (1, 3), (1, 2), (1, 1)]
    assert level_shapes(4, 2, (5, 2)) == [(8, 20), (4, 10)]
    texture = torch.arange(12.0).reshape(1, 3, 4)
    level = [torch.zeros(4, dtype=torch.int64)]
    # A texel's centre; half way to the next; half way across the right edge; the same a repeat further.
    u = torch.tensor([1.5 / 4, 2.0 / 4, 1.0, 2.0])
    v = torch.full((4,), 1.5 / 3)
    expected = [[5.0], [5.5], [(7 + 4) / 2], [(7 + 4) / 2]]
    torch.testing.assert_close(read_texture([texture], u, v, level), torch.tensor(expected))
    texture = torch.zeros(1, 64, 64, dtype=torch.float64)
    texture[0, 32, 32] = 1.0
    smooth = blurred(texture, 2.0)[0]
    distance = torch.arange(64) - 32.0
    assert smooth.sum().item() == pytest.approx(1.0)
    assert (smooth.sum(0) * distance**2).sum().item() == pytest.approx(4.0, rel=1e-3)
    assert blurred(texture, 0.2) is texture
    one = torch.ones(3, 1, 1)
    assert blurred(one, 9.0) is one
    fine = torch.zeros(1, 8, 8)
    fine[0, 4, 4] = 1.0
    sigma, place = torch.tensor([2.0 * 0.5 / 4]), torch.tensor([4.5 / 8])
    coarse = torch.zeros(1, 4, 4)
    coarse[0, 2, 2] = 1.0
    read = read_pyramid([fine, coarse], torch.tensor([2.5 / 4]), torch.tensor([2.5 / 4]), sigma, 4, blur=4.0)
    torch.testing.assert_close(read, blurred(coarse, 2.0)[:, 2, 2][None])
    read = read_pyramid([fine], place, place, sigma, 4, blur=4.0)
    torch.testing.assert_close(read, blurred(fine, 4.0)[:, 4, 4][None])


def test_what_is_exported_reads_the_same(monkeypatch):
    """Exported modules gather and add where torch sums bags: up to the order of eight terms."""
    random = torch.Generator().manual_seed(0)
    levels = [torch.randn(3, *shape, generator=random) for shape in ((8, 12), (4, 6), (2, 3), (1, 1))]
    u, v = (20.0 * torch.randn(200, generator=random) for _ in range(2))
    sigma = torch.exp2(6.0 * torch.rand(200, generator=random) - 5.0)
    bags = read_pyramid(levels, u, v, sigma, 4)
    monkeypatch.setattr(torch.compiler, "is_exporting", lambda: True)
    torch.testing.assert_close(read_pyramid(levels, u, v, sigma, 4), bags, rtol=1e-5, atol=1e-5)


def stripes(count, random):
    """Return view rays onto stripes .35 of a yarn spacing above the reference plane, up to 53 degrees, and answers."""
    (u, v), slope, turn = random.uniform(0, 2, (2, count)), random.uniform(0, 4 / 3, count), random.uniform(0, 7, count)
    wo = np.stack([slope * np.cos(turn), slope * np.sin(turn), np.ones(count)], -1)
    wo /= np.linalg.norm(wo, axis=1, keepdims=True)
    stripe, target = np.sin(np.pi * (u + 0.35 * slope * np.cos(turn))), np.zeros((count, 4))
    target[:, 2:] = 0.2 + 0.1 * np.stack([stripe, -stripe], -1)
    columns = (u, v, np.full(count, 0.1), np.tile([0.0, 0.0, 1.0], (count, 1)), wo)
    return Queries.round(*columns), target.astype(np.float32)


def error_after_a_while(options):
    torch.manual_seed(0)
    network, random = CurvedNetwork(options, (2, 2)), np.random.default_rng(1)
    optimiser = torch.optim.Adam(network.parameter_groups(1e-2))
    descend(optimiser, 150, lambda _: network.loss(batch_of(*stripes(256, random)), random))
    with torch.no_grad():
        return network.loss(batch_of(*stripes(2000, np.random.default_rng(2))), random).sqrt().item()


def test_an_offset_learns_what_heights_displace():
    """In equal steps of equal networks; without one the decoder has to learn the displacement place by place."""
    options = SMALL["curved"].model_copy(update={"blur": 0.0})
    without = error_after_a_while(options.model_copy(update={"offset": False}))
    assert error_after_a_while(options) < 0.75 * without
