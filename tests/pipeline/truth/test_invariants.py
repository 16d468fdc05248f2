import math

import numpy as np
import pytest
from scipy import stats

from pipeline.truth import invariants
from pipeline.truth.estimator import estimate
from pipeline.truth.invariants import SIGNIFICANCE, exact, quotient, worst
from tests.presets import PRESETS
from weaves.fabric import load_fabric

FABRIC = load_fabric("polyester_lining")


@pytest.fixture
def brief(monkeypatch):
    """Spend few points: a change of 30 % is found all the same."""
    fixed = invariants._fixed
    monkeypatch.setattr(invariants, "_fixed", lambda count, **choices: fixed(min(count, 512), **choices))
    monkeypatch.setattr(invariants, "_LATTICE", 32.0)
    monkeypatch.setattr(invariants, "_STEPS", 32)


def broken(test, fabric=FABRIC):
    return [item.name for item in test(fabric) if item.status == "broken"]


@pytest.mark.parametrize("test", invariants.INVARIANTS, ids=lambda test: test.__name__)
def test_a_preset_keeps_the_invariants_at_few_points(brief, test):
    found = test(FABRIC)
    assert found and not [item for item in found if item.status == "broken"]
    assert len({item.name for item in found}) == len(found)


def _scaled(factor, part=slice(None)):
    """Return a ground truth whose components of `part` are wrong by a factor, which may depend on the query."""

    def wrong(fabric, queries, options, seed, start=0):
        answers = estimate(fabric, queries, options, seed, start)
        by = np.broadcast_to(factor(queries, options), len(queries.u)).astype(np.float32)[:, None]
        mean, error = answers.mean.copy(), answers.standard_error.copy()
        mean[:, part] *= by
        error[:, part] *= np.abs(by)
        return answers._replace(mean=mean, standard_error=error)

    return wrong


def _times(number, chosen=lambda queries, options: True):
    return lambda queries, options: np.where(chosen(queries, options), number, 1.0)


SPECULAR, DIFFUSE = slice(0, 2), slice(2, 4)


@pytest.mark.parametrize(
    ("test", "wrong", "found"),
    [
        (invariants.patch_reciprocity, _scaled(lambda q, o: q.wi[:, 2], SPECULAR), ["reciprocity", "other points"]),
        (invariants.patch_reciprocity, _scaled(_times(1.1, lambda q, o: o.frame == "macro")), []),
        (invariants.range_of_values, _scaled(_times(-1.0, lambda q, o: q.sigma > 1e3)), ["negative"]),
        (invariants.range_of_values, _scaled(_times(np.nan, lambda q, o: q.wi[:, 2] < 0.02)), ["not finite"]),
        (invariants.energy, _scaled(_times(1.6), DIFFUSE), ["reflected, k_d = 1"]),
        (invariants.energy, _scaled(_times(2.0, lambda q, o: q.wi[:, 2] < 0), DIFFUSE), ["transmitted, k_dt = 1"]),
        (invariants.energy, _scaled(_times(5.0), SPECULAR), ["scattered once"]),
        (invariants.projected_area, _scaled(_times(1.3, lambda q, o: o.normaliser == "projected")), ["visible area"]),
        (invariants.repeat_average, _scaled(_times(1.3, lambda q, o: o.footprint == "box")), ["box of one", "of 3"]),
        (invariants.repeat_average, _scaled(_times(1.3, lambda q, o: q.sigma > 100)), ["of 1000 repeats"]),
        (invariants.translation, _scaled(lambda q, o: 1.0 + 1e-5 * np.floor(q.u / 2)), ["one repeat", "1000"]),
    ],
)
def test_wrong_physics_is_found(brief, monkeypatch, test, wrong, found):
    monkeypatch.setattr(invariants, "estimate", wrong)
    names = broken(test)
    assert bool(names) == bool(found), names
    for words in found:
        assert any(words in name for name in names), names


def _off(bounds):
    """Return a ground truth of which a component of quadrature is off by so many of its bounds."""

    def wrong(fabric, queries, options, *seeds):
        answers = estimate(fabric, queries, options, *seeds)
        if options.estimator == "quadrature":
            answers.mean[:, 2] += np.float32(bounds) * answers.bound[:, 2]
        return answers

    return wrong


def test_estimators_agree_within_their_bounds(brief, monkeypatch):
    """A bound of quadrature is eleven of its standard errors, which do not follow Student's t."""
    r2 = _scaled(_times(1.3, lambda q, o: o.estimator == "r2"))
    for wrong, found in ((r2, ["r2 / owen"]), (_off(1.0), []), (_off(4.0), ["quadrature / owen"])):
        monkeypatch.setattr(invariants, "estimate", wrong)
        assert broken(invariants.agreement) == found


@pytest.mark.parametrize(
    ("part", "factor", "test", "found"),
    [
        (
            "reflection",
            lambda *a: 1.0 + 1e-15 * (a[3] > a[4]),
            "point_reciprocity",
            "reciprocity of a point, reflection",
        ),
        ("_lattice", lambda *a: 1.0 + 1e-9, "repeat_average", "coloured components / coloured whole − 1"),
    ],
)
def test_a_slab_that_is_not_reciprocal_and_colour_that_does_not_add_up_are_found(
    brief, monkeypatch, part, factor, test, found
):
    whole = getattr(invariants, part)
    monkeypatch.setattr(invariants, part, lambda *a: whole(*a) * factor(*a))
    assert broken(getattr(invariants, test)) == [found]


def test_the_worst_of_many_with_its_error_is_broken_as_rarely_as_stated_and_exact_numbers_at_once():
    """Under Student's t with 15 degrees of freedom, 4,000 families of 24 numbers: Poisson, mean 4,000 SIGNIFICANCE."""
    families = 4000
    numbers = np.random.default_rng(1).standard_t(15, (families, 24))
    for relation in ("=", "<="):
        count = sum(worst("t", row, 0.0, np.ones(24), 15, relation).status == "broken" for row in numbers)
        assert count <= stats.poisson.isf(1e-3, families * SIGNIFICANCE)
        # And not much more rarely: numbers twice as far off are called broken many times.
        wide = sum(worst("t", 2 * row, 0.0, np.ones(24), 15, relation).status == "broken" for row in numbers)
        assert wide > 20
    item = worst("x", [1.0, 1.2, 0.7], 1.0, [0.1, 0.1, 0.5], 15)
    assert (item.measured, item.standard_error, item.status) == (1.2, 0.1, "statistics")
    assert item.sigmas == pytest.approx(2.0)
    assert worst("x", [0.5, 1.0], 1.0, [0.01, 0.01], 15, "<=").status == "statistics"
    assert worst("x", [0.5, 1.2], 1.0, [0.01, 0.01], 15, "<=").status == "broken"
    assert worst("x", [1.0, math.nan], 1.0, [0.1, 0.1], 15).status == "broken"
    assert worst("x", 1.0, 1.0, math.nan, 15).status == "broken"
    assert exact("x", 1e-7, 0.0, 1e-6).status == "exact"
    assert exact("x", 2e-6, 0.0, 1e-6).status == "broken"
    assert exact("x", -5.0, 0.0, 0.0).status == "broken"
    assert exact("x", math.nan, 0.0, 1.0).status == "broken"
    np.testing.assert_array_equal(quotient([0.0, 1.0, 3.0], [0.0, 0.0, 2.0]), [1.0, np.inf, 1.5])


@pytest.mark.slow
@pytest.mark.parametrize("name", PRESETS)
def test_every_preset_keeps_the_invariants(name):
    assert not [found for test in invariants.INVARIANTS for found in broken(test, load_fabric(name))]
