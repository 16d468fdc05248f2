import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.models.domain import Domain
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from tests.directions import unit
from tests.refusals import refusal
from weaves.errors import BadInput
from weaves.fabric import load_fabric

FABRICS = [load_fabric("denim"), load_fabric("silk_charmeuse")]
DENIM = FABRICS[0]  # its repeat is 4 by 4
PLAIN = Domain.of({}, FABRICS)
NARROW = Domain.of({"queries": {"sigma": [0.2, 3.0], "max_angle": 60.0}}, FABRICS)
WIDE = QueryOptions(behind=0.5, stretch=4.0, curvature=(0.01, 0.2))


def asked(**options):
    return draw_queries(QueryOptions(**options), (4, 4), 1, 0, 32)


def test_what_was_taught_is_answered_and_cards_that_say_nothing_of_view_rays_are_of_the_fabric_plane():
    """Up to 89 degrees a domain has all directions."""
    PLAIN.refuse(asked(), "m")
    wide = Domain.of({"queries": WIDE.model_dump()}, FABRICS)
    wide.refuse(draw_queries(WIDE, (4, 4), 1, 0, 32), "m")
    assert PLAIN.kinds == frozenset() and wide.kinds == {"behind", "stretch", "curvature"}
    assert not PLAIN.out_of_domain(DENIM, one(light=89.99, viewer=89.99)).any()
    PLAIN.refuse_fabric(DENIM, "m")
    PLAIN.refuse_truth(TruthOptions(relative_error=0.1), "m")
    card = PLAIN.model_dump()
    old = {name: value for name, value in card["physics"].items() if name not in ("parallax", "walls")}
    earlier = Domain.model_validate(card | {"physics": old})
    assert PLAIN.rims and not earlier.rims
    earlier.refuse_truth(TruthOptions(parallax=False), "m")
    with pytest.raises(BadInput, match=r"truth: parallax = True.*parallax = False"):
        earlier.refuse_truth(TruthOptions(), "m")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"behind": 1.0}, r"32 rows; first row 0: wi.*model m was trained for light from the viewer's side only"),
        ({"stretch": 4.0}, r"sigma_minor.*round footprints"),
        ({"curvature": (0.1, 0.1)}, r"curvature.*0.1.*flat cloth"),
    ],
)
def test_what_was_not_taught_is_refused_by_name(options, message):
    with pytest.raises(BadInput, match=message):
        PLAIN.refuse(asked(**options), "m")
    behind = asked()
    behind.wo[3] *= np.float32(-1)
    assert "1 rows; first row 3: wo" in refusal(PLAIN.refuse, behind, "m")
    with pytest.raises(BadInput, match=r"truth: frame = 'macro'.*frame = 'ply'"):
        of_plane = Domain.of({"truth": {"parallax": False}}, FABRICS)
        of_plane.refuse_truth(TruthOptions(frame="macro", parallax=False), "m")


def one(sigma=1.0, minor=None, light=10.0, viewer=10.0, curvature=0.0):
    """A single query: axes in yarn spacings, angles to the normal in degrees."""
    columns = {"sigma": sigma, "sigma_minor": minor or sigma, "curvature": curvature}
    columns |= {"wi": unit(light, 0.0), "wo": unit(viewer, 0.0)}
    columns = {name: np.array([value], np.float32) for name, value in columns.items()}
    return draw_queries(QueryOptions(), (4, 4), 1, 0, 1)._replace(**columns)


@pytest.mark.parametrize(
    ("asked", "strange"),
    [
        ({}, False),
        ({"sigma": 0.19}, False),  # 2 % of the logarithm of 15, a factor of 1.056
        ({"sigma": 0.18}, True),
        ({"light": 60.9}, False),
        ({"light": 61.2}, True),
        ({"viewer": 61.2, "light": -20.0}, True),
    ],
)
def test_scenes_are_asked_within_the_trained_ranges(asked, strange):
    assert NARROW.out_of_domain(DENIM, one(**asked)).tolist() == [strange]
    # A file of queries may ask for more: it is this model's answer that is wanted.
    NARROW.refuse(one(**asked), "m")


def test_footprints_and_bent_cloth_are_known_as_far_as_training_saw_them():
    """A Gaussian of 3 yarns is the average of a repeat of 4 to exp(-2 pi^2 .75^2) = 2e-5; of 8-end satin it is not."""
    huge = one(sigma=30.0)
    assert not NARROW.out_of_domain(DENIM, huge).any()
    assert NARROW.out_of_domain(load_fabric("satin_8"), huge).all()
    asked = NARROW.within(DENIM, huge)
    np.testing.assert_allclose([asked.sigma, asked.sigma_minor], 3.0, rtol=1e-6)
    truth = TruthOptions(estimator="quadrature", walls="left_out", relative_error=1e-4)
    found, reference = (estimate(DENIM, queries, truth, 0).mean for queries in (asked, huge))
    np.testing.assert_allclose(found, reference, rtol=2e-3)
    # Of ellipses it is the narrow axis that must see the average; axes of 17 : 1 were never seen.
    domain = Domain.of({"queries": {"sigma": [0.2, 3.0], "stretch": 16.0, "curvature": [0.01, 0.2]}}, FABRICS)
    for known in (one(sigma=8.0, minor=4.0), one(curvature=0.1), one(curvature=0.2)):
        assert not domain.out_of_domain(DENIM, known).any()
    for strange in (one(sigma=40.0, minor=4.0), one(sigma=3.4, minor=0.2), one(curvature=0.21)):
        assert domain.out_of_domain(DENIM, strange).all()


@settings(max_examples=60)
@given(sigma=st.floats(0.01, 100.0), high=st.floats(0.2, 16.0))
def test_what_is_asked_lies_within_what_was_taught(sigma, high):
    """Whatever is not strange is asked at most 2 % of the range's logarithm beyond it; nothing else is changed."""
    domain, queries = Domain.of({"queries": {"sigma": [0.1, high]}}, FABRICS), one(sigma=sigma)
    asked = domain.within(DENIM, queries)
    slack = 1.001 * (high / 0.1) ** 0.02
    if not domain.out_of_domain(DENIM, queries).any():
        assert 0.1 / slack <= asked.sigma.item() <= high * slack
    if sigma < 0.999 * high or high < 0.499 * 4:  # single precision
        assert asked is queries
