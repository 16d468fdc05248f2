import math

import mpmath
import numpy as np
import pytest

from reports.truth import formulas, stability
from reports.truth.finding import ILL, RECORDS, Finding, judge

EXPRESSIONS = list(stability.expressions())


@pytest.mark.parametrize("name", dict.fromkeys(expression.name for expression in EXPRESSIONS))
def test_corners_hold(name):
    findings = [finding for row in EXPRESSIONS if row.name == name for finding in stability.judged(row)]
    assert findings and [(f.expression, f.corner, f.fault, f.at) for f in findings if f.fault] == []


@pytest.mark.parametrize(("compare", "count"), [(stability.places, 2000), (stability.footprints, 120)])
def test_answers_far_away_are_those_at_home(compare, count):
    findings = compare()
    assert {finding.count for finding in findings} == {count}
    assert [(f.corner, f.fault, f.at) for f in findings if f.fault] == []


@pytest.mark.parametrize(
    ("name", "caught"),
    [
        ("1 − exp(−x)", {"x 0 … 80"}),
        ("σ", {"α = 0.01, near the axis", "α = 0.1, near the axis"}),
        ("D", {"α = 0.01", "α = 0.1"}),
        ("torus height", {f"u_max = {bend:g}°" for bend in stability.BENDS}),
    ],
)
def test_a_textbook_form_is_caught(name, caught):
    """As single precision would be if someone 'simplified' it: exactly the corners where it loses digits fail."""
    rows = [row._replace(single=row.naive) for row in EXPRESSIONS if row.name == name]
    findings = [finding for row in rows for finding in stability.judged(row) if not finding.corner.endswith(ILL)]
    assert {finding.corner for finding in findings if finding.fault and finding.arithmetic == "float32"} == caught


@pytest.mark.parametrize("behind", [False, True])
def test_fifty_digits_agree_with_double_precision_by_the_textbook(behind):
    """Away from the corners the textbook's double precision is good to 1e-12, and so are the 50 digits."""
    columns = stability.draw(40, 0.5, (30.0, 60.0), (20.0, 45.0), (0.5, 2.0), behind).values()
    with mpmath.workdps(stability.DIGITS):
        exact = formulas.textbook_slab(*map(formulas.exact, columns)).astype(np.float64)
    assert stability.slab_of(*columns) == pytest.approx(exact, rel=1e-12)
    assert formulas.textbook_slab(*columns) == pytest.approx(exact, rel=1e-12)


def test_formulas_on_arrays_are_those_of_the_kernels_and_fifty_digits_are_kept():
    _, wo, t, alpha, _ = stability.draw(200, 0.1, (0.0, 60.0, 89.9), (30.0, 80.0), (2.0,)).values()
    assert formulas.sigma(wo, t, alpha) == pytest.approx(stability.sigma_of(wo, t, alpha), rel=1e-15)
    with mpmath.workdps(stability.DIGITS):
        third = formulas.exact([1.0]) / formulas.exact([3.0])
        assert abs(third[0] - mpmath.mpf(1) / 3) < mpmath.mpf(10) ** -49


def found(value, reference, **more) -> Finding:
    return judge("x", "corner", "float32", {"x": np.arange(len(value))}, value, reference, 1e-6, **more)


def test_judgement_of_numbers_and_of_normals_that_may_point_down():
    good, wrong = found([1.0, 2.0], [1.0, 2.000002]), found([1.0, 2.0, 3.0], [1.0, 2.00001, 3.0])
    assert (good.holds, good.worst, good.at) == (True, pytest.approx(1e-6, rel=1e-3), "x 1")
    assert (wrong.holds, wrong.at) == (False, "x 1") and "beyond the limit 2.0e-06" in wrong.fault
    finding = found([[0.0, -1.0, 1e-9]], [[0.0, -1.0, 0.0]], signed=True)
    assert (finding.holds, finding.worst) == (True, pytest.approx(1e-9))


@pytest.mark.parametrize(("value", "fault"), [(math.nan, "NaN"), (math.inf, "NaN"), (-1e-12, "negative")])
def test_impossible_values_fail_however_small_their_error(value, fault):
    finding = found([1.0, 1.0, value], [1.0, 1.0, 1e-12], floor=1.0)
    assert (finding.holds, finding.at) == (False, "x 2") and f"1 of 3 values are {fault}" in finding.fault


def test_records_hold_the_findings_and_the_textbooks_lost_values_apart():
    findings = [
        found([1.0, 2.0], [1.0, 2.000002], naive=[math.nan, 3.0]),
        judge("y", "a | b", "float64", {"y": [3.0]}, [-1.0], [1.0], 1e-9),
    ]
    assert findings[0].naive == pytest.approx(0.5, rel=1e-5) and findings[0].holds and findings[0].naive_not_finite == 1
    again = RECORDS.from_records(RECORDS.to_records(findings))
    assert again[0] == findings[0] and [(f.corner, f.fault) for f in again] == [(f.corner, f.fault) for f in findings]
