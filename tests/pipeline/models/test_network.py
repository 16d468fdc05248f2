"""Chunks of inference, the part of a network that runs for every query, and networks of one fabric each as a method."""

import numpy as np
import pytest
import torch

from pipeline.fingerprint import fingerprint
from pipeline.models.analytic.point_sampled import PointSampledOptions
from pipeline.models.domain import Domain
from pipeline.models.network import Portable, evaluated, restored
from pipeline.models.neumip import NeumipOptions
from pipeline.models.neumip.model import NeumipNetwork
from pipeline.models.registry import load_methods
from pipeline.models.selvage import SelvageOptions
from pipeline.models.selvage.model import Selvage, SelvageNetwork
from pipeline.shards.queries import QueryOptions, draw_queries
from weaves.fabric import load_fabric

DENIM = load_fabric("denim")
REPEAT = DENIM.weave.repeat


@pytest.mark.parametrize("bound", [True, False])
def test_the_network_of_selvage_alone_answers_what_the_method_does(bound):
    torch.manual_seed(1)
    network = SelvageNetwork(SelvageOptions(width=16, measured_rows=64), [DENIM])
    torch.nn.init.normal_(network.last.weight, std=0.3)  # they are 0 at first
    method = Selvage(network).with_bound(bound)
    assert isinstance(method, Portable)
    queries = draw_queries(QueryOptions(), REPEAT, 2, 0, 300)
    own = method.predict(DENIM, queries)
    assert np.abs(own).max() > 0
    # The same products in another order: a few roundings of the largest terms.
    answers = method.per_query(DENIM).answered(queries)
    np.testing.assert_allclose(answers, own, rtol=1e-4, atol=1e-5 * np.abs(own).max())


def test_what_learns_nothing_has_no_such_part():
    (method,) = load_methods(PointSampledOptions(counts=(2,)))
    assert not isinstance(method, Portable)


QUERIES = draw_queries(QueryOptions(), (4, 4), 0, 0, 37)


@pytest.mark.parametrize("chunk", [1, 10, 37, 100])
def test_chunks_keep_the_order_of_rows_and_columns(chunk, monkeypatch):
    monkeypatch.setattr("pipeline.models.method.CHUNK_ROWS", chunk)
    found = evaluated(QUERIES, lambda q: (q.wo, q.u), lambda wo, u: torch.cat([u[:, None], wo], dim=-1))
    np.testing.assert_array_equal(found, np.concatenate([QUERIES.u[:, None], QUERIES.wo], axis=1))


def test_answers_are_as_wide_as_asked_even_of_no_rows():
    for rows in (37, 0):
        answers = evaluated(QUERIES.take(slice(0, rows)), lambda q: (q.u,), lambda u: u[:, None], 1)
        assert answers.shape == (rows, 1) and answers.dtype == np.float32


NEUMIP = NeumipOptions(texels_per_yarn=2)
CLOTHS = [load_fabric(name) for name in ("denim", "silk_charmeuse", "polyester_lining")]


def trained(fabric):
    """Return the card and the weights of a network of one fabric."""
    domain = Domain.of({}, [fabric]).model_dump(mode="json")
    card = {"fabrics": [{"optics": fingerprint(fabric.optics()), "repeat": list(fabric.weave.repeat)}]}
    return card | {"domain": domain}, NeumipNetwork(NEUMIP, fabric.weave.repeat).state_dict()


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1)])
def test_the_ranges_hold_those_of_every_fabric_and_nothing_more(order):
    """Whichever was read last."""
    parts = [trained(CLOTHS[index]) for index in order]
    networks, domain = restored(NEUMIP, parts, lambda repeat: NeumipNetwork(NEUMIP, repeat))
    assert networks.keys() == {fingerprint(fabric.optics()) for fabric in CLOTHS}
    assert domain == Domain.of({}, CLOTHS)
    assert all(domain.knows(fabric) for fabric in CLOTHS) and not domain.knows(load_fabric("voile"))
