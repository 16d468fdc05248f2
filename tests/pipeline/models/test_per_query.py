"""The part of a method that runs for every query: by itself it answers what the method answers."""

import pytest
import torch

from pipeline.fingerprint import fingerprint
from pipeline.models.btf_autoencoder.model import BtfAutoencoder
from pipeline.models.curved.model import Curved, CurvedNetwork
from pipeline.models.curved.options import CurvedOptions
from pipeline.models.neumip.model import Neumip, NeumipNetwork
from pipeline.models.neumip.options import NeumipOptions
from pipeline.models.per_query import Portable
from pipeline.models.point_sampled.options import PointSampledOptions
from pipeline.models.registry import load_methods
from pipeline.models.selvage.model import Selvage, SelvageNetwork
from pipeline.models.selvage.options import SelvageOptions
from pipeline.models.unified_btf.model import UnifiedBtf, UnifiedBtfNetwork
from pipeline.models.unified_btf.options import UnifiedBtfOptions
from pipeline.models.woven.model import Woven, WovenNetwork
from pipeline.models.woven.options import WovenOptions
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
