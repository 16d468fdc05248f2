import math

import pytest
import torch

from pipeline.models.networks.layers import component_error, perceptron, to_components, to_network
from pipeline.models.options import ComponentLossOptions


def test_layers_are_linear_with_a_relu_between_and_network_space_is_undone():
    network = perceptron(3, 8, 2, 5)
    linear = [layer for layer in network if isinstance(layer, torch.nn.Linear)]
    assert [tuple(layer.weight.shape) for layer in linear] == [(8, 3), (8, 8), (5, 8)]
    assert not any(layer.bias.any() for layer in linear)
    for layer in linear:
        torch.nn.init.normal_(layer.bias)
    expected = x = torch.rand(10, 3)
    for layer in linear[:-1]:
        expected = (expected @ layer.weight.t() + layer.bias).clamp_min(0.0)
    torch.testing.assert_close(network(x), expected @ linear[-1].weight.t() + linear[-1].bias)
    assert to_network(torch.tensor([0.1, 0.0, 0.3, 0.4]), 10.0).tolist() == pytest.approx([math.log(2), 0, 0.3, 0.4])
    assert to_components(torch.full((3, 4), -0.7), 10.0).min() == 0
    components = torch.rand(64, 4) * 20
    for k in (0.5, 10.0, 100.0):
        torch.testing.assert_close(to_components(to_network(components, k), k), components, rtol=1e-5, atol=1e-6)
    output, target = torch.tensor([[1.0, 0.0, 2.0, 0.0]]), torch.zeros(1, 4)
    options = ComponentLossOptions(specular_weight=3.0, diffuse_weight=5.0)
    assert component_error(output, target, options).item() == pytest.approx(3 * 1 / 2 + 5 * 4 / 2)
