import numpy as np
import pytest
import torch

from pipeline.models.selvage import SelvageOptions
from pipeline.models.selvage.error_network import ErrorNetwork
from tests.pipeline.models.stand_ins import descend


@pytest.mark.slow
def test_the_estimate_learns_the_mean_square_of_errors():
    """Errors whose deviation is a known function of the features: the estimate finds it to a tenth."""
    torch.manual_seed(3)
    network, random = ErrorNetwork(SelvageOptions(error_width=16), 4), np.random.default_rng(4)
    features = random.standard_normal((20_000, 4)).astype(np.float32)
    deviation = np.stack([0.05 * np.exp(features[:, 0]), 0.02 * np.exp(-0.5 * features[:, 1])], axis=1)
    errors = (deviation * random.standard_normal(deviation.shape)).astype(np.float32)
    optimiser = torch.optim.Adam(network.parameters(), 1e-2)

    def loss(step):
        rows = slice(1000 * (step % 20), 1000 * (step % 20) + 1000)
        return network.loss(torch.from_numpy(features[rows]), torch.from_numpy(errors[rows]))

    descend(optimiser, 600, loss)
    inner = np.abs(features).max(axis=1) < 1.5
    found = torch.exp(0.5 * network(torch.from_numpy(features[inner]))).numpy(force=True)
    assert np.abs(np.log(found / deviation[inner])).mean() < 0.1
