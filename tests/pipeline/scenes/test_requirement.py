import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.scenes.requirement import Requirement
from pipeline.shards.queries import QueryOptions, draw_queries
from tests.refusals import refusal

EDGES, NAMES = (0.0, 0.3, 1.0), ("small", "middle", "large")


def required(options, count=4000, margin=1.25):
    asked = {"denim": draw_queries(options, (4, 4), 1, 0, count)}
    return Requirement.of("made up", 2, asked, EDGES, NAMES, margin)


@settings(max_examples=20)
@given(
    low=st.floats(0.05, 1.0),
    factor=st.floats(1.5, 20.0),
    angle=st.floats(20.0, 89.0),
    behind=st.sampled_from([0.0, 0.3]),
    curvature=st.sampled_from([(0.0, 0.0), (0.01, 0.1)]),
)
def test_the_domain_holds_what_was_asked_and_little_else(low, factor, angle, behind, curvature):
    shape = {"behind": behind, "curvature": curvature, "directions": "hemisphere"}
    found = required(QueryOptions(sigma=(low, low * factor), max_angle=angle, **shape)).queries()
    assert found.sigma[0] <= low * 1.01 and found.sigma[1] >= low * factor * 0.99
    assert found.sigma[0] >= low / 1.26 and found.sigma[1] <= low * factor * 1.26
    assert angle - 1.0 <= found.max_angle <= max(angle + 1.0, angle + 0.26 * (90 - angle))
    assert found.behind == pytest.approx(behind, abs=0.05) and (found.behind > 0) == (behind > 0)
    assert found.stretch == 1.0
    assert (found.curvature == (0.0, 0.0)) == (curvature == (0.0, 0.0))


def test_stretched_footprints_keep_their_ratio_and_area_and_classes_of_size_sum_to_one():
    shaped = required(QueryOptions(sigma=(0.5, 0.5), stretch=4.0, behind=0.5, curvature=(0.01, 0.1)))
    assert 3.9 <= shaped.stretch <= 4.0 * 1.26
    assert shaped.sigma == pytest.approx((0.4, 0.625), rel=1e-3)
    assert not shaped.queries(frozenset()).kinds
    assert shaped.queries(frozenset({"behind"})).behind > 0.4
    found = required(QueryOptions(sigma=(0.05, 32.0)))
    assert sum(found.sizes.values()) == pytest.approx(1.0)
    # Log-uniform: each class has the share of its width in the logarithm.
    assert found.sizes["small"] == pytest.approx(np.log(0.3 / 0.05) / np.log(32 / 0.05), abs=0.03)
    assert "no cloth that is lit" in refusal(required, QueryOptions(), count=0)
