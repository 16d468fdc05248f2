import math

import pytest
import torch

from pipeline.models.networks.losses import to_components, to_network, weighted_error


def test_network_space_is_undone():
    components = torch.rand(64, 4, generator=torch.Generator().manual_seed(3)) * 20
    for k in (0.5, 10.0, 100.0):
        torch.testing.assert_close(to_components(to_network(components, k), k), components, rtol=1e-5, atol=1e-6)


def test_only_the_specular_pair_is_squeezed():
    assert to_network(torch.tensor([0.1, 0.0, 0.3, 0.4]), 10.0).tolist() == pytest.approx([math.log(2), 0, 0.3, 0.4])


def test_components_are_never_negative():
    assert to_components(torch.full((3, 4), -0.7), 10.0).min() == 0


def test_weights_apply_to_the_mean_of_each_pair():
    output, target = torch.tensor([[1.0, 0.0, 2.0, 0.0]]), torch.zeros(1, 4)
    assert weighted_error(output, target, 3.0, 5.0).item() == pytest.approx(3 * 1 / 2 + 5 * 4 / 2)
