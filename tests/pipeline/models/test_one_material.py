"""Networks of one fabric each, loaded as one method."""

import numpy as np
import pytest

from pipeline.fingerprint import fingerprint
from pipeline.models.curved import CurvedOptions
from pipeline.models.curved.model import Curved, CurvedNetwork
from pipeline.models.domain import Domain
from pipeline.models.fallback import Fallback, fallback_answers
from pipeline.models.network import restored
from pipeline.models.neumip import NeumipOptions
from pipeline.models.neumip.model import NeumipNetwork, restore
from pipeline.shards.queries import QueryOptions, draw_queries
from weaves.fabric import load_fabric

SMALL = NeumipOptions(texels_per_yarn=2)
CLOTHS = [load_fabric(name) for name in ("denim", "silk_charmeuse", "polyester_lining")]


def card(fabric, about=None):
    repeat = list(fabric.weave.repeat)
    domain = Domain.of(about or {}, [fabric]).model_dump(mode="json")
    return {"fabrics": [{"optics": fingerprint(fabric.optics()), "repeat": repeat}], "domain": domain}


def trained(fabrics):
    return [(card(fabric), NeumipNetwork(SMALL, fabric.weave.repeat).state_dict()) for fabric in fabrics]


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1)])
def test_every_fabric_is_known_whichever_was_read_last(order):
    (method,) = restore(SMALL, trained([CLOTHS[index] for index in order]))
    for fabric in CLOTHS:
        queries = draw_queries(QueryOptions(sigma=(0.5, 1.0)), fabric.weave.repeat, 3, 0, 8)
        assert method.covers(fabric)
        assert not Fallback(method, ()).out_of_domain(fabric, queries).any()


def test_yarns_unlike_all_of_them_are_not_known():
    _, domain = restored(SMALL, trained(CLOTHS), lambda repeat: NeumipNetwork(SMALL, repeat))
    assert all(domain.knows(fabric) for fabric in CLOTHS)
    assert not domain.knows(load_fabric("voile"))
    # The ranges hold those of every fabric and nothing more.
    assert domain == Domain.of({}, CLOTHS)


def test_cloth_steeper_than_was_taught_is_quadratures():
    """The scenes' drape bends up to 1 a yarn; `curved` knows up to .5, and refuses beyond."""
    denim, options = CLOTHS[0], CurvedOptions(texels_per_yarn=2, silhouette_texels_per_yarn=1)
    about = {"queries": {"curvature": [0.01, 0.2], "behind": 0.5}}
    network = CurvedNetwork(options, denim.weave.repeat)
    method = Curved({fingerprint(denim.optics()): network}, Domain.of(about, [denim]))
    queries = draw_queries(QueryOptions(curvature=(0.1, 1.0)), denim.weave.repeat, 3, 0, 40)
    fallback, steep = Fallback(method, options.kinds), queries.curvature > 0.2
    assert steep.any() and not steep.all()
    np.testing.assert_array_equal(fallback.out_of_domain(denim, queries), steep)
    found = fallback.predict(denim, queries)
    np.testing.assert_array_equal(found[~steep], method.predict(denim, queries.take(~steep)))
    np.testing.assert_array_equal(found[steep], fallback_answers(denim, queries.take(steep), 0))
