"""What a scene asks: ranges that hold its questions, and nothing that never occurs."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.models.domain import Domain
from pipeline.scenes.requirement import Requirement
from pipeline.shards.queries import QueryOptions, draw_queries
from weaves.errors import BadInput
from weaves.fabric import load_fabric

EDGES, NAMES = (0.0, 0.3, 1.0), ("small", "middle", "large")


def required(options, count=4000, margin=1.25):
    asked = {"denim": draw_queries(options, (4, 4), 1, 0, count)}
    return Requirement.of("made up", 2, asked, EDGES, NAMES, margin)


@settings(max_examples=20, deadline=None)
@given(
    low=st.floats(0.05, 1.0),
    factor=st.floats(1.5, 20.0),
    angle=st.floats(20.0, 89.0),
    behind=st.sampled_from([0.0, 0.3]),
    curvature=st.sampled_from([(0.0, 0.0), (0.01, 0.1)]),
)
def test_the_domain_holds_what_was_asked_and_little_else(low, factor, angle, behind, curvature):
    options = QueryOptions(
        sigma=(low, low * factor), max_angle=angle, behind=behind, curvature=curvature, directions="hemisphere"
    )
    found = required(options).queries()
    assert found.sigma[0] <= low * 1.01 and found.sigma[1] >= low * factor * 0.99
    assert found.sigma[0] >= low / 1.26 and found.sigma[1] <= low * factor * 1.26
    assert angle - 1.0 <= found.max_angle <= max(angle + 1.0, angle + 0.26 * (90 - angle))
    assert found.behind == pytest.approx(behind, abs=0.05) and (found.behind > 0) == (behind > 0)
    assert found.stretch == 1.0
    assert (found.curvature == (0.0, 0.0)) == (curvature == (0.0, 0.0))


def test_stretched_footprints_keep_their_ratio_and_their_area():
    found = required(QueryOptions(sigma=(0.5, 0.5), stretch=4.0))
    assert 3.9 <= found.stretch <= 4.0 * 1.26
    assert found.sigma[0] == pytest.approx(0.4, rel=1e-3) and found.sigma[1] == pytest.approx(0.625, rel=1e-3)


def test_what_a_model_does_not_know_is_not_asked_of_it():
    found = required(QueryOptions(behind=0.5, stretch=4.0, curvature=(0.01, 0.1)))
    assert found.queries(frozenset()).plain
    assert found.queries(frozenset({"behind"})).behind > 0.4


def test_classes_of_size_sum_to_one():
    found = required(QueryOptions(sigma=(0.05, 32.0)))
    assert sum(found.sizes.values()) == pytest.approx(1.0)
    # Log-uniform: each class has the share of its width in the logarithm.
    assert found.sizes["small"] == pytest.approx(np.log(0.3 / 0.05) / np.log(32 / 0.05), abs=0.03)


def test_a_scene_without_lit_cloth_is_one_sentence():
    with pytest.raises(BadInput, match="no cloth that is lit"):
        required(QueryOptions(), count=0)


@settings(max_examples=20, deadline=None)
@given(
    low=st.floats(0.05, 1.0),
    factor=st.floats(1.0, 20.0),
    angle=st.floats(20.0, 89.0),
    stretch=st.sampled_from([1.0, 6.0]),
    curvature=st.sampled_from([(0.0, 0.0), (0.01, 0.1)]),
    margin=st.sampled_from([1.0, 1.25, 2.0]),
)
def test_a_model_taught_what_a_scene_requires_answers_for_it(low, factor, angle, stretch, curvature, margin):
    """But for the rarest: 5e-4 at either end of the sizes, and of the largest ratio, curvature and angles."""
    options = QueryOptions(sigma=(low, low * factor), max_angle=angle, stretch=stretch, curvature=curvature)
    asked = draw_queries(options, (4, 4), 2, 0, 4000)
    taught = Requirement.of("made up", 1, {"denim": asked}, EDGES, NAMES, margin).queries()
    denim = load_fabric("denim")
    domain = Domain.of({"queries": taught.model_dump()}, [denim])
    assert not domain.faults(asked, "m")
    # Two ends and four quantities, of 4,000 queries: two each, and one more for the quantile between two of them.
    assert domain.out_of_domain(denim, asked).sum() <= 6 * 3
