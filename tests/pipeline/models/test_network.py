"""Chunks of inference, and the part of a network that runs for every query."""

import numpy as np
import pytest
import torch

from pipeline.fingerprint import fingerprint
from pipeline.models.analytic.point_sampled import PointSampledOptions
from pipeline.models.btf_autoencoder.model import BtfAutoencoder
from pipeline.models.curved import CurvedOptions
from pipeline.models.curved.model import Curved, CurvedNetwork
from pipeline.models.network import Portable, in_chunks, loaded
from pipeline.models.neumip import NeumipOptions
from pipeline.models.neumip.model import Neumip, NeumipNetwork
from pipeline.models.registry import load_methods
from pipeline.models.selvage import SelvageOptions
from pipeline.models.selvage.model import Selvage, SelvageNetwork
from pipeline.models.unified_btf import UnifiedBtfOptions
from pipeline.models.unified_btf.model import UnifiedBtf, UnifiedBtfNetwork
from pipeline.models.woven import WovenOptions
from pipeline.models.woven.model import Woven, WovenNetwork
from pipeline.shards.queries import QueryOptions, draw_queries
from weaves.fabric import load_fabric

DENIM = load_fabric("denim")
OPTICS, REPEAT = fingerprint(DENIM.optics()), DENIM.weave.repeat
SMALL_BTF = UnifiedBtfOptions(texels_per_yarn=2)


def corrected(**options):
    """A selvage whose last weights are not 0, as they are at first."""
    network = SelvageNetwork(SelvageOptions(width=16, measured_rows=64, **options), [DENIM])
    torch.nn.init.normal_(network.last.weight, std=0.3)
    return Selvage(network)


METHODS = {
    "woven": lambda: Woven(WovenNetwork(WovenOptions(map_texels=16, latent=16, hidden=32))),
    "woven, transmission": lambda: Woven(WovenNetwork(WovenOptions(map_texels=16, latent=16, transmission=True))),
    "neumip": lambda: Neumip("neumip", {OPTICS: NeumipNetwork(NeumipOptions(texels_per_yarn=4), REPEAT)}),
    "curved": lambda: Curved("curved", {OPTICS: CurvedNetwork(CurvedOptions(texels_per_yarn=4), REPEAT)}),
    "unified_btf": lambda: UnifiedBtf(UnifiedBtfNetwork(SMALL_BTF)),
    "btf_autoencoder": lambda: BtfAutoencoder("btf", {OPTICS: UnifiedBtf(UnifiedBtfNetwork(SMALL_BTF))}),
    "selvage": corrected,
    "selvage, unbounded": lambda: corrected().with_bound(False),
}


@pytest.mark.parametrize("name", METHODS)
def test_the_module_alone_answers_what_the_method_does(name):
    torch.manual_seed(1)
    method = METHODS[name]()
    assert isinstance(method, Portable)
    queries = draw_queries(QueryOptions(), REPEAT, 2, 0, 300)
    part = method.per_query(DENIM)
    with torch.inference_mode():
        answers = part.module(*map(torch.from_numpy, part.inputs(queries)), *part.constants)
    own = torch.from_numpy(method.predict(DENIM, queries))
    assert own.abs().max() > 0
    # The same products in another order: a few roundings of the largest terms.
    torch.testing.assert_close(answers, own, rtol=1e-4, atol=1e-5 * float(own.abs().max()))


def test_what_learns_nothing_has_no_such_part():
    (method,) = load_methods(PointSampledOptions(counts=(2,)))
    assert not isinstance(method, Portable)


QUERIES = draw_queries(QueryOptions(), (4, 4), 0, 0, 37)
CPU = torch.device("cpu")


@pytest.mark.parametrize("chunk", [1, 10, 37, 100])
def test_chunks_keep_the_order_of_rows_and_columns(chunk, monkeypatch):
    monkeypatch.setattr("pipeline.models.network.CHUNK_ROWS", chunk)
    asked = in_chunks(QUERIES, lambda wo, u: torch.cat([u[:, None], wo], dim=-1), CPU, ("wo", "u"), 4)
    np.testing.assert_array_equal(asked, np.concatenate([QUERIES.u[:, None], QUERIES.wo], axis=1))


def test_answers_are_as_wide_as_asked_even_of_no_rows():
    for rows in (37, 0):
        answers = in_chunks(QUERIES.take(slice(0, rows)), lambda u: u[:, None], CPU, ("u",), 1)
        assert answers.shape == (rows, 1) and answers.dtype == np.float32


def test_weights_of_another_network_are_refused():
    weights = torch.nn.Linear(2, 3).state_dict()
    assert torch.equal(loaded(torch.nn.Linear(2, 3), weights).weight, weights["weight"])
    with pytest.raises(RuntimeError):
        loaded(torch.nn.Linear(3, 2), weights)
