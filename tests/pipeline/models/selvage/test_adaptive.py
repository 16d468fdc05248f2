"""Estimated errors, and who answers at a wished one."""

import numpy as np
import pytest
import torch

from pipeline.models.analytic.soft_nodes import SoftNodes
from pipeline.models.fallback import fallback_answers
from pipeline.models.registry import load_model, pretrained_folder
from pipeline.models.selvage import SelvageOptions
from pipeline.models.selvage.error_network import FINEST, FLOOR, OWN, ErrorNetwork, colour_weights
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from weaves.errors import BadInput
from weaves.fabric import load_fabric
from weaves.population import Population, population_fabrics


@pytest.fixture(scope="module")
def selvage():
    (method,) = load_model(pretrained_folder("selvage"))
    return method


@pytest.fixture(scope="module")
def denim():
    return load_fabric("denim")


@pytest.mark.slow
def test_the_estimate_learns_the_mean_square_of_errors():
    """Errors whose deviation is a known function of the features: the estimate finds it to a tenth."""
    torch.manual_seed(3)
    network, random = ErrorNetwork(SelvageOptions(error_width=16), 4), np.random.default_rng(4)
    features = random.standard_normal((20_000, 4)).astype(np.float32)
    deviation = np.stack([0.05 * np.exp(features[:, 0]), 0.02 * np.exp(-0.5 * features[:, 1])], axis=1)
    errors = (deviation * random.standard_normal(deviation.shape)).astype(np.float32)
    optimiser = torch.optim.Adam(network.parameters(), 1e-2)
    for step in range(600):
        rows = slice(1000 * (step % 20), 1000 * (step % 20) + 1000)
        loss = network.loss(torch.from_numpy(features[rows]), torch.from_numpy(errors[rows]))
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
    inner = np.abs(features).max(axis=1) < 1.5
    found = torch.exp(0.5 * network(torch.from_numpy(features[inner]))).numpy(force=True)
    assert np.abs(np.log(found / deviation[inner])).mean() < 0.1


def test_who_answers(selvage, denim):
    """Each query is answered by the first answer whose estimated error is small enough."""
    queries = draw_queries(QueryOptions(), denim.weave.repeat, 8, 0, 600)
    own, errors = selvage.with_errors(denim, queries)
    np.testing.assert_array_equal(own, selvage.predict(denim, queries))
    wished = float(np.quantile(errors[:, OWN], 0.5))
    answers = selvage.within(wished).predict(denim, queries, 5)
    first = errors[:, OWN] <= wished
    second = ~first & (errors[:, FINEST] <= wished)
    left = ~first & ~second
    assert min(first.sum(), second.sum(), left.sum()) > 10
    np.testing.assert_array_equal(answers[first], own[first])
    np.testing.assert_array_equal(answers[second], SoftNodes(8).predict(denim, queries.take(second)))
    np.testing.assert_array_equal(answers[left], fallback_answers(denim, queries.take(left), 5))


@pytest.mark.slow
def test_light_from_behind_is_answered_by_the_finest_nodes(selvage, denim):
    queries = draw_queries(QueryOptions(behind=0.5), denim.weave.repeat, 1, 0, 64)
    behind = queries.wi[:, 2] < 0
    method = selvage.within(0.05)
    found = method.predict(denim, queries)
    np.testing.assert_array_equal(found[behind], SoftNodes(8).predict(denim, queries.take(behind)))
    np.testing.assert_array_equal(found[~behind], method.predict(denim, queries.take(~behind)))
    np.testing.assert_array_equal(method.transparency(denim, queries), SoftNodes(8).transparency(denim, queries))


@pytest.mark.parametrize("error", [0.0, 1.0, -0.1, float("nan")])
def test_an_impossible_error_is_refused(selvage, error):
    with pytest.raises(BadInput, match="above 0 and below 1"):
        selvage.within(error)


@pytest.mark.slow
def test_estimates_are_calibrated_on_cloth_never_seen():
    """Root mean squares of true errors lie within a factor of 1.5 of the estimated ones, in fifths of the estimate.

    Patches that are hidden almost wholly are left out: a limit of visibility decides whether the truth is 0 there.
    """
    (method,) = load_model(pretrained_folder("selvage"))
    families = ("plain", "compound_twill", "large_satin", "irregular")
    population = Population(count=8, seed=7719, families=families, balanced=True, solid=0.5)
    weights, estimated, true = np.array(colour_weights(SelvageOptions())), [], []
    for fabric in population_fabrics(population):
        queries = draw_queries(QueryOptions(sigma=(0.1, 8.0)), fabric.weave.repeat, 12, 0, 1500)
        truth = estimate(fabric, queries, TruthOptions(relative_error=0.01), 3)
        values, errors = method.with_errors(fabric, queries)
        colour, seen = values @ weights, truth.mean.any(axis=1) & values.any(axis=1)
        noise = np.linalg.norm(truth.standard_error * weights, axis=1) / (colour + FLOOR)
        excess = np.square((colour - truth.mean @ weights) / (colour + FLOOR)) - np.square(noise)
        estimated.append(errors[seen, OWN])
        true.append(excess[seen])
    order = np.argsort(np.concatenate(estimated))
    for part in np.array_split(order, 5):
        ratio = np.sqrt(np.concatenate(true)[part].mean() / np.square(np.concatenate(estimated)[part]).mean())
        assert 1 / 1.5 < ratio < 1.5
