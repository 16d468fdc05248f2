import numpy as np
import torch

from pipeline.fingerprint import fingerprint
from pipeline.models.btf_autoencoder import BtfAutoencoderOptions
from pipeline.models.btf_autoencoder.model import build, restore
from pipeline.models.network import NetworkMethod
from pipeline.shards.queries import QueryOptions, draw_queries
from weaves.fabric import load_fabric

SMALL = BtfAutoencoderOptions(texels_per_yarn=2, samples=4, fewest_samples=2, encoder_hidden=8, weights=4, hidden=8)
LINING, BASKET = load_fabric("polyester_lining"), load_fabric("basket")


def untrained(*fabrics):
    wanted = SMALL.angular_samples
    samples = [wanted.answer(fabric, 0, wanted.count(fabric)) for fabric in fabrics]
    return build(SMALL, fabrics, samples)


def card_of(fabric):
    return {"fabrics": [{"name": fabric.name, "optics": fingerprint(fabric.optics()), "repeat": [0, 0]}]}


def test_a_network_knows_one_fabric():
    network = untrained(LINING)
    (method,) = restore(SMALL, [(card_of(LINING), network.state_dict())])
    assert method.covers(LINING)
    assert method.covers(LINING.model_copy(update={"name": "other"}))
    assert not method.covers(BASKET)
    method.prepare(LINING)
    queries = draw_queries(QueryOptions(), (2, 2), 5, 0, 32)
    np.testing.assert_array_equal(method.predict(LINING, queries), NetworkMethod(network).predict(LINING, queries))


def test_each_fabric_is_answered_by_its_own_network():
    weights = []
    for seed, fabric in enumerate((LINING, BASKET)):
        torch.manual_seed(seed)
        weights.append((card_of(fabric), untrained(fabric).state_dict()))
    (both,) = restore(SMALL, weights)
    queries = draw_queries(QueryOptions(), (2, 2), 5, 0, 8)
    for fabric, trained in zip((LINING, BASKET), weights, strict=True):
        (alone,) = restore(SMALL, [trained])
        np.testing.assert_array_equal(both.predict(fabric, queries), alone.predict(fabric, queries))
        assert both.bytes_stored(fabric) == alone.bytes_stored(fabric)
