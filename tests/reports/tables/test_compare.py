import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reports.record import Provenance, Record, this_machine
from reports.tables.compare import LEVEL, compare, holm, refuse_other_machine
from tests.refusals import refusal

REPEATS, NOISE = 25, 0.02


def time_of(method, samples, **about):
    subject = Record(method=method, threads=1, **about)
    return subject.of("time", float(np.median(samples)), len(samples), samples=tuple(samples))


def readings(random, median=1000.0, methods=8):
    """Times of some methods, each with a noise of 2 % and now and then a call that something else held up."""
    times = median * (1 + NOISE * random.standard_normal((methods, REPEATS)))
    times *= np.where(random.random(times.shape) < 0.04, 3.0, 1.0)
    return [time_of(f"m{index}", row.tolist()) for index, row in enumerate(times)]


def error_of(method, value, standard_error, fabric="denim", scene="queries"):
    subject = Record(method=method, fabric=fabric, scene=scene)
    return subject.of("mse", value, 400, standard_error=standard_error)


def verdicts(a, b):
    found = compare(a, b)
    return [one.result for one in (*found.times, *found.errors)]


def test_a_shift_of_5_percent_is_marked_and_nothing_where_nothing_differs():
    """25 readings with 2 % noise: the shift is 2.5 sigmas, U lies 5.6 sigmas off, and is missed once in 500 times."""
    random = np.random.default_rng(1)
    a, b = readings(random), readings(random)
    slower, faster = readings(random, 1050.0), readings(random, 950.0)
    assert verdicts(a, [slower[0], faster[1], *b[2:]]) == ["slower", "faster", *["no difference shown"] * 6]
    # Of 200 comparisons of 8 equal methods at most 5 % mark any: 19 or more do with a chance below 1 %.
    random = np.random.default_rng(2)
    marked = sum(set(verdicts(readings(random), readings(random))) != {"no difference shown"} for _ in range(200))
    assert LEVEL == 0.05 and marked < 19


def test_errors_are_held_against_their_standard_errors_and_not_tested_without():
    """Gaps of 2.2, 2.2, 4.5 and -4.5 standard errors of the difference; 2.2 would be shown alone, and not in pairs."""
    a = [error_of(name, value, 0.3) for name, value in (("m", 1.0), ("n", 1.0), ("worse", 1.0), ("better", 3.0))]
    b = [error_of(name, value, 0.4) for name, value in (("m", 2.1), ("n", 2.1), ("worse", 3.25), ("better", 0.75))]
    assert verdicts(a, b) == ["no difference shown"] * 2 + ["higher", "lower"]
    assert verdicts(a[:1], b[:1]) == ["higher"]
    assert compare(a[:1], b[:1]).errors[0].p == pytest.approx(0.0278, abs=1e-4)  # 2 (1 - Phi(2.2))
    assert compare(a[2:3], b[2:3]).errors[0].ratio == 3.25 and verdicts(a, a) == ["no difference shown"] * 4
    with_samples = time_of("m", [1.0, 2.0, 3.0])
    without = with_samples.model_copy(update={"samples": ()})
    exact = error_of("m", 1.0, None)
    found = compare([with_samples, exact], [without, error_of("m", 9.0, 0.1)])
    assert [one.result for one in (*found.times, *found.errors)] == ["not tested"] * 2
    # What is not tested does not make the others stricter.
    more = compare([without, error_of("m", 1.0, 0.1)], [without, error_of("m", 2.0, 0.1)])
    assert more.errors[0].p == compare([error_of("m", 1.0, 0.1)], [error_of("m", 2.0, 0.1)]).errors[0].p


def trained(values, standard_error, fabric="denim"):
    """The errors of several trainings of a network."""
    errors = [error_of("net", value, standard_error, fabric) for value in values]
    about = [{"provenance": Provenance(model="0", seed=seed)} for seed in range(len(errors))]
    return [error.model_copy(update=update) for error, update in zip(errors, about, strict=True)]


@pytest.mark.parametrize(
    ("a", "b", "spread", "result"),
    [
        ([1.0, 1.5, 2.0], [2.4, 2.6, 3.1], 0.01, "higher"),  # 1.2 between the means, ranges 1 and .7
        ([1.0, 1.5, 2.0], [2.3, 2.4, 2.8], 0.01, "within trainings"),  # 1
        ([1.0, 1.0, 1.0], [2.0, 1.0, 3.0], 0.01, "within trainings"),  # 1, of B's range of 2
        ([1.5], [2.4, 2.6, 3.1], 0.01, "higher"),  # 1.2, of the one range of .7
        ([1.5], [2.7], 0.01, "higher"),
        ([1.0, 1.5, 2.0], [2.4, 2.6, 3.1], 0.6, "no difference shown"),  # 1.4 standard errors
    ],
)
def test_a_difference_exceeds_the_interval_and_the_range_over_trainings(a, b, spread, result):
    first, second = trained(a, spread), trained(b, spread)
    assert verdicts(first, second) == [result]
    opposite = {"higher": "lower"}.get(result, result)
    assert verdicts(second, first) == [opposite]
    (row,) = compare(first, second).errors
    assert row.a.value == pytest.approx(np.mean(a)) and row.b.value == pytest.approx(np.mean(b))


@pytest.mark.slow
def test_the_range_of_three_trainings_is_exceeded_by_chance_as_often_as_stated():
    """5 of 100; 4.85 % by 400,000 draws. Of 4,000 pairs 132 to 256 lie within 4.6 standard deviations."""
    random = np.random.default_rng(3)
    pairs = np.moveaxis(random.standard_normal((4000, 2, 3)), 1, 0) + 10.0
    a, b = ([r for name, row in enumerate(rows) for r in trained(row, 1e-9, str(name))] for rows in pairs)
    results = verdicts(a, b)
    assert len(results) == 4000 and 132 <= results.count("lower") + results.count("higher") <= 256


def test_like_is_compared_with_like_and_nothing_in_common_is_bad_input():
    """Threads, settings, fabrics, edits and times of unseen fabrics are kept apart; other metrics are left out."""
    fast, slow = [1.0 + 0.01 * i for i in range(9)], [2.0 + 0.01 * i for i in range(9)]
    one, two = time_of("m", fast), time_of("m", slow).model_copy(update={"threads": 2})
    edits = [
        Record(method="m", note=note).of("encode_time", 1.0, 9, samples=tuple(times))
        for note, times in (("a yarn", slow), ("a colour", fast))
    ]
    other = [error_of("m", 1.0, 0.1, scene="sphere"), Record(method="m").of("bytes_stored", 7.0, 1)]
    other += [error_of("m", 1.0, 0.1, "denim"), error_of("gone", 1.0, 0.1)]
    a = [one, two, time_of("m", slow, role="unseen"), *edits, *other]
    found = compare(a, [*reversed(a[:-1]), error_of("m", 5.0, 0.1, "basket"), time_of("new", fast)])
    assert len(found.times) == 5 and len(found.errors) == 1
    assert all(row.a == row.b and row.result == "no difference shown" for row in (*found.times, *found.errors))
    assert (found.only_a, found.only_b) == (1, 2)
    assert "share no measurement" in refusal(compare, [error_of("m", 1.0, 0.1)], [error_of("n", 1.0, 0.1)])


def test_what_else_differs_is_said_and_holm_is_that_of_its_textbook():
    a = time_of("m", [1.0, 2.0], note="512 queries a fabric", provenance=Provenance(dataset="a"))
    b = time_of("m", [1.0, 2.0], note="1024 queries a fabric", provenance=Provenance(dataset="b", version=1))
    assert compare([a], [a]).unlike == []
    assert [sentence.split()[-1] for sentence in compare([a], [b]).unlike] == ["sets", "benchmark", "m"]
    once = "one training in A and B: another training of net may differ by more than is marked here"
    assert compare(trained([1.0], 0.1), trained([2.0], 0.1)).unlike == [once]
    assert compare(trained([1.0], 0.1), trained([2.0, 2.1], 0.1)).unlike == []
    # Four p-values .01, .04, .03, .005 at their ranks: .005 x 4, .01 x 3, .03 x 2, and .04 no less than that.
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02]) and holm([]) == []


@pytest.mark.parametrize("change", [{"cpu": "another"}, {"cores": 99}, {"threads": 7}])
def test_another_machine_is_refused_unless_asked_for(change):
    here = this_machine(1)
    there = here.model_copy(update=change)
    ((name, value),) = change.items()
    sentence = refusal(refuse_other_machine, here, there)
    assert "--other-machine" in sentence and f"{name} of B = {value!r}" in sentence
    (sentence,) = refuse_other_machine(here, there, allow=True)
    assert str(value) in sentence
    later = here.model_copy(update={"date": "2000-01-01T00:00:00+00:00", "packages": {}})
    assert refuse_other_machine(here, later) == []


@given(st.lists(st.floats(0, 1) | st.just(math.nan), max_size=12))
def test_corrected_p_values_keep_the_order_and_are_no_smaller(p_values):
    """Between the uncorrected ones and Bonferroni's, in the same order; what is not tested takes no part."""
    corrected = holm(p_values)
    tested = [(p, c) for p, c in zip(p_values, corrected, strict=True) if not math.isnan(p)]
    assert [math.isnan(p) for p in p_values] == [math.isnan(c) for c in corrected]
    assert all(p <= c <= min(1.0, len(tested) * p) for p, c in tested)
    assert [c for _, c in sorted(tested)] == sorted(c for _, c in tested)
