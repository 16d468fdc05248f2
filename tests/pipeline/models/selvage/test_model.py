import numpy as np
import pytest
import torch

from pipeline.analytic.soft_nodes.features import EXCHANGED, EXCHANGED_SIGN, read_queries
from pipeline.analytic.soft_nodes.nodes import tabulate
from pipeline.compiled.arrays import nbytes
from pipeline.models.analytic.soft_nodes import SoftNodes
from pipeline.models.domain import Domain
from pipeline.models.fallback import fallback_answers
from pipeline.models.selvage import SelvageOptions
from pipeline.models.selvage.error_network import FINEST, FLOOR, OWN, colour_weights
from pipeline.models.selvage.model import Selvage, SelvageNetwork
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from tests.pipeline.models.against_truth import truth_of
from tests.pipeline.models.stand_ins import SMALL, batch_of, descend
from weaves.errors import BadInput
from weaves.fabric import load_fabric
from weaves.population import Population, population_fabrics

SELVAGE = SMALL["selvage"]


FABRICS = [load_fabric("polyester_lining"), load_fabric("cotton_twill")]
LINING, TWILL = FABRICS


def drawn(fabric, seed, rows, **options):
    return draw_queries(QueryOptions(**options), fabric.weave.repeat, seed, 0, rows)


def true_batch(seed, rows):
    """Return a step about the second fabric, with the truth as its target."""
    asked = drawn(TWILL, seed, rows)
    return batch_of(asked, truth_of(TWILL, asked), 1)


def trained_a_little(steps):
    """Return a network after some steps on one batch, with its losses."""
    network, batch = SelvageNetwork(SELVAGE, FABRICS), true_batch(5, 256)
    optimiser = torch.optim.AdamW(network.parameter_groups(1e-2))
    return network, descend(optimiser, steps, lambda step: network.loss(batch, np.random.default_rng(step)))


@pytest.mark.slow
def test_it_learns_and_training_sees_what_rendering_sees():
    """The loss falls by a fifth; against the network's own predictions it is 0."""
    network, losses = trained_a_little(60)
    assert losses[-1] < 0.8 * losses[0]
    method = Selvage(network)
    asked = drawn(TWILL, 9, 64)
    answers = method.predict(TWILL, asked)
    assert np.abs(answers - SoftNodes().predict(TWILL, asked)).max() > 1e-3
    read = network._read(batch_of(asked, answers, 1))
    answer = network(read.features, read.components, read.bounds)
    assert network.correction_loss(answer, read.target).item() < 1e-10


def test_what_nodes_give_of_a_row_is_computed_once(monkeypatch):
    """Rows of earlier steps in another order, beside new and held-out ones: the same bits, exchanged or not."""
    asked, counts = drawn(TWILL, 3, 64, stretch=8.0), []
    network, keeping = SelvageNetwork(SELVAGE, FABRICS), SelvageNetwork(SELVAGE, FABRICS)
    keeping.expect(70)

    def counted(table, queries):
        counts.append(len(queries.u))
        return read_queries(table, queries)

    def equal(row, numbers):
        batch = batch_of(asked.take(row), np.ones((len(row), 4), np.float32), 1)
        expected, counts[:] = network._read(batch), []
        found = keeping._read(batch._replace(row=torch.from_numpy(numbers)[None]))
        for one, other in zip((*found, *found.exchanged()), (*expected, *expected.exchanged()), strict=True):
            assert torch.equal(one, other)
        return list(counts)

    monkeypatch.setattr("pipeline.models.selvage.model.read_queries", counted)
    order = np.random.default_rng(1).permutation(64)
    assert equal(order[:40], order[:40]) == [40, 40]
    assert equal(order[::-1], order[::-1].copy()) == [24, 24]
    assert equal(order, np.where(order < 10, -1, order)) == [10, 10]


def test_normalised_features_have_mean_0_and_deviation_1():
    network = SelvageNetwork(SelvageOptions(width=16), FABRICS)
    cases = ((fabric, drawn(fabric, 40 + index, 2000)) for index, fabric in enumerate(FABRICS))
    features = np.concatenate([read_queries(tabulate(fabric), asked)[0] for fabric, asked in cases])
    features = np.concatenate([features, features[:, EXCHANGED] * EXCHANGED_SIGN])
    normal = (features - network.mean.numpy()) * network.scale.numpy()
    varied = features.std(axis=0) > 0.01
    np.testing.assert_allclose(normal.mean(axis=0), 0.0, atol=0.1)
    np.testing.assert_allclose(normal[:, varied].std(axis=0), 1.0, atol=0.3)  # hidden patches are rare


def test_exchanged_batches_teach_exchanged_answers():
    """A batch and its exchange cost a network that knows nothing of the exchange the same, in both orders."""
    batch = true_batch(3, 64)
    seeds = [next(s for s in range(50) if np.random.default_rng(s).integers(2) == side) for side in (0, 1)]
    for steps in (0, 5):
        network, _ = trained_a_little(steps)
        straight, exchanged = (network.loss(batch, np.random.default_rng(seed)).item() for seed in seeds)
        assert (straight == pytest.approx(exchanged, rel=1e-5)) == (steps == 0)


def test_viewers_behind_the_cloth_are_refused():
    asked = drawn(LINING, 1, 8)
    with pytest.raises(BadInput, match="selvage"):
        Selvage(SelvageNetwork(SELVAGE)).predict(LINING, asked._replace(wo=-asked.wo))


def test_an_untrained_network_is_the_soft_nodes_over_curved_cloth_too():
    """A flat row beside curved ones keeps its bits."""
    network = SelvageNetwork(SELVAGE.model_copy(update={"bound": False}))
    fabric, method = LINING, Selvage(network)
    weights = network.architecture()["parameters"]["total"]
    assert method.bytes_stored(fabric) == nbytes(tabulate(fabric)) + 4 * weights
    asked = drawn(fabric, 1, 64, curvature=(0.05, 0.5))
    asked.curvature[::3] = 0.0
    found = method.predict(fabric, asked)
    np.testing.assert_allclose(found, SoftNodes().predict(fabric, asked), rtol=1e-5, atol=1e-7)
    flat = method.predict(fabric, asked._replace(curvature=np.zeros(64, np.float32)))
    np.testing.assert_array_equal(found[::3], flat[::3])
    assert (found != flat).any()


@pytest.mark.parametrize("finest", [False, True])
def test_light_from_behind_is_answered_by_the_soft_nodes(finest):
    """By the finest ones, if an error is wished."""
    fabric, method, nodes = LINING, Selvage(SelvageNetwork(SELVAGE), Domain.of({}, FABRICS)), SoftNodes()
    if finest:
        method, nodes = method.within(0.05), SoftNodes(8)
    asked = drawn(fabric, 1, 64, behind=0.5)
    behind = asked.wi[:, 2] < 0
    found = method.predict(fabric, asked)
    np.testing.assert_array_equal(found[behind], nodes.predict(fabric, asked.take(behind)))
    np.testing.assert_array_equal(found[~behind], method.predict(fabric, asked.take(~behind)))
    np.testing.assert_array_equal(method.transparency(fabric, asked), nodes.transparency(fabric, asked))


def test_footprints_of_view_rays_are_those_of_its_soft_nodes():
    """In training and in rendering; of the finest ones, where the fallback means other walls."""
    fabric, options = LINING, SELVAGE.model_copy(update={"walls": "left_out"})
    asked = drawn(fabric, 1, 64, sigma=(0.1, 0.5))
    network, nodes = SelvageNetwork(options, [fabric]), SoftNodes(walls="left_out")
    method, expected = Selvage(network), nodes.predict(fabric, asked)
    np.testing.assert_allclose(method.predict(fabric, asked), expected, rtol=1e-5, atol=1e-7)
    np.testing.assert_array_equal(network._read(batch_of(asked, expected)).components, expected)
    assert np.abs(expected - SoftNodes().predict(fabric, asked)).max() > 0.1 * expected.max()
    finest = SoftNodes(8, walls="left_out").predict(fabric, asked)
    np.testing.assert_array_equal(method.within(1e-6).predict(fabric, asked), finest)


def test_a_network_told_to_shine_is_bounded():
    """Factors of 2 everywhere: with the bound no component exceeds the sums without shadows; without it some do."""
    asked = drawn(LINING, 1, 200)
    bounds = read_queries(tabulate(LINING), asked).bounds
    for bound in (True, False):
        network = SelvageNetwork(SELVAGE.model_copy(update={"bound": bound}))
        torch.nn.init.constant_(network.last.bias, 30.0)
        assert (Selvage(network).predict(LINING, asked) <= bounds).all() == bound


def test_who_answers(selvage):
    """Each query is answered by the first answer whose estimated error is small enough."""
    denim = load_fabric("denim")
    queries = drawn(denim, 8, 600)
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
def test_estimates_are_calibrated_on_cloth_never_seen(selvage):
    """Root mean squares of true errors lie within a factor of 1.5 of the estimated ones, in fifths of the estimate.
    Patches that are hidden almost wholly are left out: a limit of visibility decides whether the truth is 0 there."""
    families = ("plain", "compound_twill", "large_satin", "irregular")
    population = Population(count=8, seed=7719, families=families, balanced=True, solid=0.5)
    weights, estimated, true = np.array(colour_weights(SelvageOptions())), [], []
    for fabric in population_fabrics(population):
        queries = drawn(fabric, 12, 1500, sigma=(0.1, 8.0))
        truth = estimate(fabric, queries, TruthOptions(relative_error=0.01), 3)
        values, errors = selvage.with_errors(fabric, queries)
        colour, seen = values @ weights, truth.mean.any(axis=1) & values.any(axis=1)
        noise = np.linalg.norm(truth.standard_error * weights, axis=1) / (colour + FLOOR)
        excess = np.square((colour - truth.mean @ weights) / (colour + FLOOR)) - np.square(noise)
        estimated.append(errors[seen, OWN])
        true.append(excess[seen])
    order = np.argsort(np.concatenate(estimated))
    for part in np.array_split(order, 5):
        ratio = np.sqrt(np.concatenate(true)[part].mean() / np.square(np.concatenate(estimated)[part]).mean())
        assert 1 / 1.5 < ratio < 1.5
