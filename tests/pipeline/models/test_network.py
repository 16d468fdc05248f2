import numpy as np
import pytest
import torch
from torch import nn

from pipeline.fingerprint import fingerprint
from pipeline.models.domain import Domain
from pipeline.models.network import NetworkMethod, PerQuery, restored
from pipeline.models.neumip.model import NeumipNetwork
from pipeline.models.registry import restore_methods
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.query import Queries
from tests.pipeline.models.stand_ins import SMALL, card_of, untrained
from weaves.fabric import load_fabric

DENIM, BASKET = load_fabric("denim"), load_fabric("basket")


@pytest.mark.parametrize("model", SMALL)
def test_restored_weights_answer_alike_also_at_extremes(model):
    """Finite and not negative; alike in every repeat, and wherever a footprint sees thousands of them. A network of one
    material knows its fabric whatever its name is; any other answers for a fabric never seen."""
    options = SMALL[model]
    network = untrained(options, DENIM)
    (method,) = restore_methods(options, [(card_of(DENIM), network.state_dict())])
    fabric = DENIM if options.of_one_material else BASKET
    assert method.covers(fabric) and method.covers(fabric.model_copy(update={"name": "other"}))
    assert method.covers(BASKET) != options.of_one_material
    angles, centres = np.radians([0.0, 89.0, 89.9]), [0.25, 0.25 - 2**20, 0.0, -1e-30]
    sigma, i, o, centre = np.meshgrid([1e-4, 0.25, 1e4], angles, angles, centres, indexing="ij")
    wi, wo = (np.stack([x * np.sin(w), y * np.sin(w), np.cos(w)], -1) for w, x, y in ((i, 0.6, 0.8), (o, 1.0, 0.0)))
    columns = (centre, -3.0 * centre, sigma)
    queries = Queries.round(*(column.ravel() for column in columns), wi.reshape(-1, 3), wo.reshape(-1, 3))
    found = method.predict(fabric, queries)
    assert found.shape == (108, 4) and found.dtype == np.float32
    assert np.isfinite(found).all() and (found >= 0).all()
    by_centre = found.reshape(3, 9, 4, 4)
    # Some processors sum a row's products in another order by its place in the batch: a few roundings.
    np.testing.assert_allclose(by_centre[:, :, 0::2], by_centre[:, :, 1::2], rtol=1e-5, atol=1e-7)
    assert np.ptp(by_centre[0], axis=1).max() > 0
    np.testing.assert_allclose(by_centre[2], by_centre[2][:, :1].repeat(4, 1), rtol=1e-4, atol=1e-6)
    np.testing.assert_array_equal(found, NetworkMethod(network).predict(fabric, queries))
    # Ten lights at each of six places share what does not depend on them.
    lit = draw_queries(QueryOptions(), fabric.weave.repeat, 5, 0, 60)
    together, apart = lit.take(np.repeat(np.arange(6), 10))._replace(wi=lit.wi), np.arange(60).reshape(6, 10).T.ravel()
    own, alone = method.predict(fabric, together), method.predict(fabric, together.take(apart))
    np.testing.assert_allclose(own[apart], alone, rtol=1e-5, atol=1e-7)


def test_each_fabric_is_answered_by_its_own_network_and_their_domains_are_joined():
    options, cloths = SMALL["neumip"], [load_fabric(name) for name in ("denim", "silk_charmeuse", "polyester_lining")]
    parts = [(card_of(cloth, Domain.of({}, [cloth])), untrained(options, cloth).state_dict()) for cloth in cloths]
    queries = draw_queries(QueryOptions(), (4, 4), 5, 0, 8)
    for order in ((0, 1, 2), (2, 0, 1)):
        networks, domain = restored(options, [parts[k] for k in order], lambda repeat: NeumipNetwork(options, repeat))
        assert networks.keys() == {fingerprint(cloth.optics()) for cloth in cloths}
        assert domain == Domain.of({}, cloths)
        assert all(domain.knows(cloth) for cloth in cloths) and not domain.knows(load_fabric("voile"))
    together = NetworkMethod(networks)
    for cloth, part in zip(cloths, parts, strict=True):
        (alone,) = restore_methods(options, [part])
        np.testing.assert_array_equal(together.predict(cloth, queries), alone.predict(cloth, queries))
        assert together.bytes_stored(cloth) == alone.bytes_stored(cloth)


def test_chunks_keep_the_order_of_rows_and_columns(monkeypatch):
    """Answers are as wide as asked even of no rows."""
    queries = draw_queries(QueryOptions(), (4, 4), 0, 0, 37)
    part = PerQuery(lambda queries: None, lambda q: (q.wo, q.u), nn.Identity())
    for chunk in (1, 10, 37, 100):
        monkeypatch.setattr("pipeline.models.method.CHUNK_ROWS", chunk)
        found = part.answered(queries, lambda wo, u: torch.cat([u[:, None], wo], dim=-1))
        np.testing.assert_array_equal(found, np.concatenate([queries.u[:, None], queries.wo], axis=1))
        for rows in (37, 0):
            answers = part.answered(queries.take(slice(0, rows)), lambda wo, u: u[:, None], 1)
            assert answers.shape == (rows, 1) and answers.dtype == np.float32
