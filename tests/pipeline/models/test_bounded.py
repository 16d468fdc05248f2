import numpy as np
import pytest

from pipeline.models.analytic.soft_nodes import SoftNodes
from pipeline.models.bounded import Bounded, limited
from pipeline.shards.queries import QueryOptions, draw_queries
from tests.pipeline.models.stand_ins import FakeMethod
from weaves.errors import BadInput
from weaves.fabric import load_fabric


@pytest.mark.parametrize(("name", "behind"), [("denim", 0.0), ("voile", 1.0)])
def test_what_is_below_the_bound_stays_as_it_is(name, behind):
    # Shadows only take light away: the sums themselves lie below their bound.
    fabric = load_fabric(name)
    queries = draw_queries(QueryOptions(behind=behind), fabric.weave.repeat, 3, 0, 500)
    sums = SoftNodes()
    # Where there is no shadow both are one sum, rounded twice: what is cut, a last digit of 1, goes to the other yarn.
    expected = sums.predict(fabric, queries)
    np.testing.assert_allclose(Bounded(sums).predict(fabric, queries), expected, rtol=1e-6, atol=1.2e-7)


@pytest.mark.parametrize(
    ("components", "bounds", "expected"),
    [
        ([0.1, 0.2, 0.3, 0.4], [0.1, 0.3, 0.3, 0.5], [0.1, 0.2, 0.3, 0.4]),
        # The excess of the warp goes to the weft, and that of specular light stays specular.
        ([0.5, 0.0, 3.0, 0.0], [0.2, 9.0, 1.0, 5.0], [0.2, 0.3, 1.0, 2.0]),
        # As far as there is room.
        ([0.0, 4.0, 3.0, 4.5], [0.5, 2.0, 1.0, 5.0], [0.5, 2.0, 1.0, 5.0]),
        ([8.0, 8.0, 8.0, 8.0], [0.1, 0.2, 0.3, 0.4], [0.1, 0.2, 0.3, 0.4]),
        # Only the weft is seen, and the method takes it for the warp.
        ([0.0, 0.0, 2.0, 0.0], [0.0, 1.0, 0.0, 2.0], [0.0, 0.0, 0.0, 2.0]),
    ],
)
def test_an_excess_goes_to_the_other_yarn_up_to_its_bound(components, bounds, expected):
    found = limited(np.array([components], np.float32), np.array([bounds], np.float32))
    np.testing.assert_allclose(found, [expected], rtol=1e-6)


def test_it_is_named_apart_and_refuses_curved_cloth():
    bounded, fabric = Bounded(FakeMethod()), load_fabric("voile")
    assert (bounded.name, bounded.setting) == ("fake", "bounded")
    assert bounded.bytes_stored(fabric) > 48
    with pytest.raises(BadInput, match="flat cloth"):
        bounded.predict(fabric, draw_queries(QueryOptions(curvature=(0.1, 0.2)), fabric.weave.repeat, 3, 0, 5))
