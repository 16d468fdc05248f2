import pytest
import torch

from pipeline.models.networks.perceptron import perceptron


@pytest.fixture(autouse=True)
def _fixed_weights():
    torch.manual_seed(0)


def test_it_is_linear_layers_with_a_relu_between_each_two():
    network = perceptron(3, 8, 2, 5)
    linear = [layer for layer in network if isinstance(layer, torch.nn.Linear)]
    assert [tuple(layer.weight.shape) for layer in linear] == [(8, 3), (8, 8), (5, 8)]
    x = torch.rand(10, 3)
    expected = x
    for layer in linear[:-1]:
        expected = (expected @ layer.weight.t() + layer.bias).clamp_min(0.0)
    torch.testing.assert_close(network(x), expected @ linear[-1].weight.t() + linear[-1].bias)


def test_before_it_learns_it_is_homogeneous():
    """Biases begin at 0, so that twice the input gives twice the output."""
    network, x = perceptron(3, 8, 3, 5), torch.rand(10, 3)
    torch.testing.assert_close(network(2.0 * x), 2.0 * network(x))
