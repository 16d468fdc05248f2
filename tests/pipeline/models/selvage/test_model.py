"""The network, the method, and who answers at a wished error."""

import numpy as np
import pytest
import torch

from pipeline.analytic.soft_nodes.features import EXCHANGED, EXCHANGED_SIGN, read_queries
from pipeline.analytic.soft_nodes.nodes import tabulate
from pipeline.compiled.arrays import nbytes
from pipeline.models.analytic.soft_nodes import SoftNodes
from pipeline.models.domain import Domain
from pipeline.models.fallback import fallback_answers
from pipeline.models.method import Method
from pipeline.models.network import Batch
from pipeline.models.registry import load_model, module_of, pretrained_folder
from pipeline.models.selvage import SelvageOptions
from pipeline.models.selvage.error_network import FINEST, FLOOR, OWN, colour_weights
from pipeline.models.selvage.model import Selvage, SelvageNetwork
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from weaves.errors import BadInput
from weaves.fabric import load_fabric
from weaves.population import Population, population_fabrics

SMALL = SelvageOptions(width=16, measured_rows=64)


@pytest.fixture(scope="module")
def fabrics():
    return [load_fabric("polyester_lining"), load_fabric("cotton_twill")]


def batch_of(fabric, index, seed, rows, answers=None):
    asked = draw_queries(QueryOptions(), fabric.weave.repeat, seed, 0, rows)
    if answers is None:
        answers = estimate(fabric, asked, TruthOptions(estimator="node_table"), 1).mean
    columns = (*asked, answers, np.zeros(rows, np.float32))
    return asked, Batch(torch.tensor([index]), *(torch.from_numpy(column)[None] for column in columns))


def trained_a_little(fabrics, options=SMALL, steps=60):
    """Return a network after some steps on one batch, with its losses."""
    network = SelvageNetwork(options, fabrics)
    _, batch = batch_of(fabrics[1], 1, 5, 256)
    optimiser = torch.optim.AdamW(network.parameter_groups(1e-2))
    losses = []
    for step in range(steps):
        loss = network.loss(batch, np.random.default_rng(step))
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        losses.append(loss.item())
    return network, losses


@pytest.fixture(scope="module")
def learnt(fabrics):
    """A network after five steps, which no test changes."""
    torch.manual_seed(0)
    return trained_a_little(fabrics, steps=5)[0]


@pytest.mark.parametrize(("width", "count"), [(16, 2374), (32, 3878), (64, 8422)])
def test_number_of_parameters(width, count):
    assert SelvageNetwork(SelvageOptions(width=width)).architecture()["parameters"]["total"] == count


def test_an_untrained_network_is_the_sums(fabrics):
    asked = draw_queries(QueryOptions(), fabrics[0].weave.repeat, 1, 0, 64)
    method = Selvage(SelvageNetwork(SMALL))
    assert isinstance(method, Method)
    np.testing.assert_allclose(method.predict(fabrics[0], asked), SoftNodes().predict(fabrics[0], asked), rtol=1e-6)


@pytest.mark.slow
def test_it_learns_and_training_sees_what_rendering_sees(fabrics):
    """The loss falls by a fifth; against the network's own predictions it is 0."""
    network, losses = trained_a_little(fabrics)
    assert losses[-1] < 0.8 * losses[0]
    method = Selvage(network)
    asked, _ = batch_of(fabrics[1], 1, 9, 64)
    answers = method.predict(fabrics[1], asked)
    assert np.abs(answers - SoftNodes().predict(fabrics[1], asked)).max() > 1e-3
    _, batch = batch_of(fabrics[1], 1, 9, 64, answers)
    kept = SelvageNetwork(SMALL.model_copy(update={"exchange": False}), fabrics)
    kept.load_state_dict(network.state_dict())
    read = kept._read(batch)
    answer = kept(read.features, read.components, read.bounds)
    assert kept.correction_loss(answer, read.target).item() < 1e-10


def test_normalised_features_have_mean_0_and_deviation_1(fabrics):
    network = SelvageNetwork(SelvageOptions(width=16), fabrics)
    rows = []
    for index, fabric in enumerate(fabrics):
        asked = draw_queries(QueryOptions(), fabric.weave.repeat, 40 + index, 0, 2000)
        rows.append(read_queries(tabulate(fabric), asked)[0])
    features = np.concatenate(rows)
    features = np.concatenate([features, features[:, EXCHANGED] * EXCHANGED_SIGN])
    normal = (features - network.mean.numpy()) * network.scale.numpy()
    varied = features.std(axis=0) > 0.01
    np.testing.assert_allclose(normal.mean(axis=0), 0.0, atol=0.1)
    np.testing.assert_allclose(normal[:, varied].std(axis=0), 1.0, atol=0.3)  # hidden patches are rare


def test_exchanged_batches_teach_exchanged_answers(fabrics, learnt):
    """A batch and its exchange cost a network that knows nothing of the exchange the same, in both orders."""
    _, batch = batch_of(fabrics[1], 1, 3, 64)
    seeds = [next(s for s in range(50) if np.random.default_rng(s).integers(2) == side) for side in (0, 1)]
    straight, exchanged = (learnt.loss(batch, np.random.default_rng(seed)).item() for seed in seeds)
    assert straight != exchanged
    untrained = SelvageNetwork(SMALL, fabrics)
    straight, exchanged = (untrained.loss(batch, np.random.default_rng(seed)).item() for seed in seeds)
    assert straight == pytest.approx(exchanged, rel=1e-5)


def test_a_trained_folder_comes_back(fabrics, learnt):
    module = module_of("selvage")
    (method,) = module.restore(SMALL, [({}, learnt.state_dict())])
    asked = draw_queries(QueryOptions(), fabrics[0].weave.repeat, 1, 0, 64)
    np.testing.assert_array_equal(method.predict(fabrics[0], asked), Selvage(learnt).predict(fabrics[0], asked))
    table = nbytes(tabulate(fabrics[0]))
    assert method.bytes_stored(fabrics[0]) == table + 4 * 2374
    assert learnt.mean.abs().max() > 0


def test_extreme_queries_are_answered_with_finite_numbers(fabrics, learnt):
    angles, sizes = np.radians([0.0, 89.0, 89.9]), [1e-3, 0.25, 1e4]
    i, o, sigma, centre = (
        axis.ravel().astype(np.float32) for axis in np.meshgrid(angles, angles, sizes, [1e6 + 0.3, -1e6], indexing="ij")
    )
    wi = np.stack([0.6 * np.sin(i), 0.8 * np.sin(i), np.cos(i)], axis=1).astype(np.float32)
    wo = np.stack([np.sin(o), 0 * o, np.cos(o)], axis=1).astype(np.float32)
    answers = Selvage(learnt).predict(fabrics[1], Queries.round(centre, -centre, sigma, wi, wo))
    assert np.isfinite(answers).all()
    assert (answers >= 0).all()


def test_it_refuses_what_it_was_not_taught(fabrics):
    domain = Domain.of({}, fabrics)
    method = Selvage(SelvageNetwork(SMALL), domain)
    asked = draw_queries(QueryOptions(), fabrics[0].weave.repeat, 1, 0, 8)
    changed = asked._replace(wo=-asked.wo)
    with pytest.raises(BadInput, match="selvage"):
        method.predict(fabrics[0], changed)
    # Without a domain it still knows no more than the sums do.
    with pytest.raises(BadInput, match="selvage"):
        Selvage(SelvageNetwork(SMALL)).predict(fabrics[0], changed)


def test_the_network_corrects_soft_nodes_over_curved_cloth(fabrics):
    """An untrained network is the soft nodes; a flat row beside curved ones keeps its bits."""
    fabric, method = fabrics[0], Selvage(SelvageNetwork(SMALL.model_copy(update={"bound": False})))
    asked = draw_queries(QueryOptions(curvature=(0.05, 0.5)), fabric.weave.repeat, 1, 0, 64)
    asked.curvature[::3] = 0.0
    found = method.predict(fabric, asked)
    np.testing.assert_allclose(found, SoftNodes().predict(fabric, asked), rtol=1e-5, atol=1e-7)
    flat = method.predict(fabric, asked._replace(curvature=np.zeros(64, np.float32)))
    np.testing.assert_array_equal(found[::3], flat[::3])
    assert (found != flat).any()


@pytest.mark.parametrize("finest", [False, True])
def test_light_from_behind_is_answered_by_the_soft_nodes(fabrics, finest):
    """By the finest ones, if an error is wished."""
    fabric, method, nodes = fabrics[0], Selvage(SelvageNetwork(SMALL), Domain.of({}, fabrics)), SoftNodes()
    if finest:
        method, nodes = method.within(0.05), SoftNodes(8)
    asked = draw_queries(QueryOptions(behind=0.5), fabric.weave.repeat, 1, 0, 64)
    behind = asked.wi[:, 2] < 0
    found = method.predict(fabric, asked)
    np.testing.assert_array_equal(found[behind], nodes.predict(fabric, asked.take(behind)))
    np.testing.assert_array_equal(found[~behind], method.predict(fabric, asked.take(~behind)))
    np.testing.assert_array_equal(method.transparency(fabric, asked), nodes.transparency(fabric, asked))


def test_a_network_told_to_shine_is_bounded(fabrics):
    """Factors of 2 everywhere: with the bound no component exceeds the sums without shadows; without it some do."""
    fabric = fabrics[0]
    asked = draw_queries(QueryOptions(), fabric.weave.repeat, 1, 0, 200)
    bounds = read_queries(tabulate(fabric), asked).bounds
    for bound in (True, False):
        network = SelvageNetwork(SMALL.model_copy(update={"bound": bound}))
        torch.nn.init.constant_(network.last.bias, 30.0)
        answers = Selvage(network).predict(fabric, asked)
        assert (answers <= bounds).all() == bound


@pytest.fixture(scope="module")
def selvage():
    (method,) = load_model(pretrained_folder("selvage"))
    return method


def test_who_answers(selvage):
    """Each query is answered by the first answer whose estimated error is small enough."""
    denim = load_fabric("denim")
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
def test_estimates_are_calibrated_on_cloth_never_seen(selvage):
    """Root mean squares of true errors lie within a factor of 1.5 of the estimated ones, in fifths of the estimate.

    Patches that are hidden almost wholly are left out: a limit of visibility decides whether the truth is 0 there.
    """
    families = ("plain", "compound_twill", "large_satin", "irregular")
    population = Population(count=8, seed=7719, families=families, balanced=True, solid=0.5)
    weights, estimated, true = np.array(colour_weights(SelvageOptions())), [], []
    for fabric in population_fabrics(population):
        queries = draw_queries(QueryOptions(sigma=(0.1, 8.0)), fabric.weave.repeat, 12, 0, 1500)
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
