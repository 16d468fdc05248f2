import math

import pytest

from reports.record import Machine, Provenance
from reports.tables.readme import ROWS, kept_time, readme_block, three_decimals, two_digits
from weaves.errors import BadInput

MACHINE = Machine(cpu="Test CPU", cores=2, threads=2, system="", python="", packages={}, date="2026-01-01")


@pytest.fixture
def records(made_up):
    named = Provenance(recipe="quick")
    return [record.model_copy(update={"provenance": named}) for record in made_up]


def slower(records, method, factor):
    """Records in which one method takes longer."""
    return [
        record.model_copy(update={"value": factor * record.value})
        if record.metric == "time" and record.method == method
        else record
        for record in records
    ]


def test_rows_hold_the_numbers_of_the_records(records):
    block = readme_block(records, MACHINE, "", "file")
    # Points have an MSE of 1e-3 / k on denim, twice that on basket, and cost 400 k; the others are points with k = 9.
    assert "| two random points, exact shadows | 7.5e−4 | 1× | 1× | 0.150 | 1× |" in block
    assert "| sixteen random points | 9.4e−5 | 8× | 8× | 0.019 | 7.8× |" in block
    assert f"| {ROWS['woven', '']} | 1.7e−4 | 4.5× | 4.5× | −0.001 | 4.3× |" in block
    assert "`selvage`" not in block, "a method that was not measured has no row"
    assert (
        "`woven` has 4.5× lower MSE than two points on seen fabrics, 4.5× on unseen ones, at 4.3× their time" in block
    )
    bounded = [one.model_copy(update={"setting": "bounded"}) for one in records if one.method == "woven"]
    both = readme_block([*records, *bounded], MACHINE, "", "file")
    assert f"| {ROWS['woven', '']} |" in both and f"| {ROWS['woven', 'bounded']} |" in both
    assert "\n`woven` under the energy bound has 4.5× lower MSE" in both and "\n`woven` has" not in both
    assert "Recipe `quick`" in block and "1,200 held-out queries of 2 seen and 1 unseen fabrics" in block


def test_several_unseen_fabrics_have_an_interval(two_unseen):
    """A second unseen fabric on which woven errs four times as much: 4.5 and 1.125 times lower.

    The geometric mean is 2.25, the interval exp(t_{.975, 1} ln(4) / 2) times less and more, t = 12.7062.
    """
    high = 2.25 * math.exp(12.7062 * math.log(4) / 2)
    named = Provenance(recipe="quick")
    block = readme_block([r.model_copy(update={"provenance": named}) for r in two_unseen], MACHINE, "", "file")
    assert f"| {ROWS['woven', '']} | 1.7e−4 | 4.5× | 2.2× (0.00034 … {high:,.0f}) | −0.001 | 4.3× |" in block
    assert "| two random points, exact shadows | 7.5e−4 | 1× | 1× | 0.150 | 1× |" in block
    assert f"| {ROWS['neumip', '']} | 1.7e−4 | 4.5× | 4.5× |" in block
    assert "in parentheses its 95 % interval over fabrics" in block


def test_several_trainings_have_their_mean_and_range(three_trainings):
    named = [
        one.model_copy(update={"provenance": one.provenance.model_copy(update={"recipe": "quick"})})
        for one in three_trainings
    ]
    block = readme_block(named, MACHINE, "", "file")
    assert f"| {ROWS['woven', '']} | 3.3e−4 | 2.2× [1.5 … 4.5×] | 2.2× [1.5 … 4.5×] | −0.002 | 4.3× |" in block
    assert f"| {ROWS['neumip', '']} | 1.7e−4 | 4.5× | 4.5× |" in block
    assert "Networks: means over 1 and 3 trainings, in brackets the least and the most of them." in block


def test_a_fresh_run_changes_no_byte_while_times_are_within_a_quarter(records):
    old = readme_block(records, MACHINE, "", "file")
    assert readme_block(slower(records, "woven", 1.2), MACHINE, old, "file") == old
    changed = readme_block(slower(records, "woven", 1.3), MACHINE, old, "file")
    expected = [line.replace("4.3×", "5.6×") if "`woven`" in line else line for line in old.splitlines()]
    assert changed.splitlines() == expected


@pytest.mark.parametrize(
    ("printed", "fresh", "expected"),
    [
        ("2×", 2.5, "2×"),
        ("2×", 1.6, "2×"),
        ("2×", 2.6, "2.6×"),
        ("2×", 1.5, "1.5×"),
        ("–", 3.21, "3.2×"),
        ("12×", 11.8, "12×"),
    ],
)
def test_a_time_is_kept_within_a_quarter(printed, fresh, expected):
    assert kept_time(printed, fresh) == expected


def test_numbers_have_no_sign_at_zero():
    assert [three_decimals(value) for value in (-0.0004, 0.0, -0.0123)] == ["0.000", "0.000", "−0.012"]
    assert [two_digits(value) for value in (0.00123, 0.1)] == ["1.2e−3", "1.0e−1"]


def test_records_without_the_baseline_are_refused(records):
    rest = [record for record in records if record.method != "point_sampled"]
    with pytest.raises(BadInput, match="two random points"):
        readme_block(rest, MACHINE, "", "file")
