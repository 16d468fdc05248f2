import math

import pytest

from reports.record import Machine, Record
from reports.tables import documents
from reports.tables.documents import MARKERS, README_METHODS, readme_block, results_page, split_at_block
from tests.refusals import refusal

MACHINE = Machine(
    cpu="Test CPU", cores=2, threads=2, system="Linux", python="3.11", packages={"numpy": "2.0"}, date="2026-01-01T12"
)


def named(records, **about):
    """Return Records that name their recipe."""
    about = {"recipe": "quick", **about}
    return [r.model_copy(update={"provenance": r.provenance.model_copy(update=about)}) for r in records]


@pytest.fixture
def records(made_up):
    return named(made_up)


def test_rows_hold_the_numbers_of_the_records(records):
    block = readme_block(records, MACHINE, "", "file")
    # Points have an MSE of 1e-3 / k on denim, twice that on basket, and cost 400 k; the others are points with k = 9.
    assert "| two random points, exact shadows | 7.5e−4 | 1× | 1× | 0.15 | 1× |" in block
    assert "| sixteen random points | 9.4e−5 | 8× | 8× | 0.02 | 7.8× |" in block
    assert f"| {README_METHODS['woven', '']} | 1.7e−4 | 4.5× | 4.5× | 0.00 | 4.3× |" in block
    assert README_METHODS["soft_nodes", "k = 2"] not in block, "a method that was not measured has no row"
    ours = "`woven` has 4.5× lower MSE than two points on seen fabrics at 4.3× their time, and 4.5× on unseen ones"
    assert ours in block
    bounded = [record.model_copy(update={"setting": "bounded"}) for record in records if record.method == "woven"]
    both = readme_block([*records, *bounded], MACHINE, "", "file")
    assert f"| {README_METHODS['woven', '']} |" in both and f"| {README_METHODS['woven', 'bounded']} |" in both
    assert "\n`woven` under the energy bound has 4.5× lower MSE" in both and "\n`woven` has" not in both
    assert "Recipe `quick`" in block and "1,200 held-out queries of 2 seen and 1 unseen fabrics" in block


def test_several_unseen_fabrics_have_an_interval_and_trainings_a_mean_and_a_range(two_unseen, three_trainings):
    """A second unseen fabric on which woven errs four times as much: 4.5 and 1.125 times lower.

    The geometric mean is 2.25, the interval exp(t_{.975, 1} ln(4) / 2) times less and more, t = 12.7062.
    """
    high = 2.25 * math.exp(12.7062 * math.log(4) / 2)
    block = readme_block(named(two_unseen), MACHINE, "", "file")
    assert f"| {README_METHODS['woven', '']} | 1.7e−4 | 4.5× | 2.2× (0.00034 … {high:,.0f}×) | 0.00 | 4.3× |" in block
    assert "| two random points, exact shadows | 7.5e−4 | 1× | 1× | 0.15 | 1× |" in block
    assert f"| {README_METHODS['neumip', '']} | 1.7e−4 | 4.5× | 4.5× |" in block
    assert "in parentheses its 95 % interval over fabrics" in block
    block = readme_block(named(three_trainings), MACHINE, "", "file")
    assert f"| {README_METHODS['woven', '']} | 3.3e−4 | 2.2× [1.5 … 4.5×] | 2.2× [1.5 … 4.5×] | 0.00 | 4.3× |" in block
    # Trained once, on a single unseen fabric: no range, so no number.
    assert f"| {README_METHODS['neumip', '']} | 1.7e−4 | 4.5× | – | 0.03 |" in block
    assert "–: one training, one fabric: no range." in block
    assert "Networks: means over 1 and 3 trainings, in brackets the least and the most of them." in block


def test_a_fresh_run_changes_no_byte_while_times_are_within_a_quarter(records):
    factors = {("neumip", "time"): 1.2, ("woven", "time"): 1.3}
    slower = [r.model_copy(update={"value": factors.get((r.method, r.metric), 1) * r.value}) for r in records]
    old = readme_block(records, MACHINE, "", "file")
    expected = [line.replace("4.3×", "5.6×") if "`woven`" in line else line for line in old.splitlines()]
    assert readme_block(slower, MACHINE, old, "file").splitlines() == expected
    assert [documents.kept_time("2×", fresh) for fresh in (2.5, 1.6, 2.6, 1.5)] == ["2×", "2×", "2.6×", "1.5×"]
    assert [documents.kept_time("–", 3.21), documents.kept_time("12×", 11.8)] == ["3.2×", "12×"]
    assert [documents.two_decimals(value) for value in (-0.004, 0.0, -0.123)] == ["0.00", "0.00", "−0.12"]


def test_records_without_the_baseline_are_refused_and_without_two_random_points_have_no_ratios(records, made_up):
    rest = [record for record in records if record.method != "point_sampled"]
    assert "two random points" in refusal(readme_block, rest, MACHINE, "", "file")
    assert "names no recipe" in refusal(results_page, made_up, MACHINE, "file")
    page = results_page([record for record in records if record.method != "point_sampled"], MACHINE, "file")
    unseen = page.partition("### Errors, unseen")[2].partition("##")[0]
    (line,) = (line for line in unseen.splitlines() if line.startswith("| woven"))
    assert [cell.strip() for cell in line.split("|")][4] == "–"
    assert "\n\n\n" not in page, "a section without sentences has no empty paragraph"


def test_the_file_says_where_its_numbers_come_from_and_a_block_is_replaced_alone(made_up):
    rate = Record(method="truth", setting="everything").of("rate", 4.5e8, 1).model_copy(update={"unit": "points/s"})
    about = {"recipe": "standard", "recipe_fingerprint": "0123456789abcdef" * 4}
    page = results_page(named([*made_up, rate], **about), MACHINE, "file")
    head = page.partition("## ")[0]
    for words in ("`standard`", "`0123456789abcdef`", "Test CPU, 2 cores", "numpy 2.0", "Measured on 2026-01-01"):
        assert words in head
    assert "| points, k = 16 | 9.38e−5 (0.87 … 1.01)e−4 |" in page.replace("\N{NO-BREAK SPACE}", " ")
    assert "| everything | – | 4.5e+08 points/s |  |" in page
    assert "## Scenes" not in page, "what was not measured has no section"
    for table in page.split("\n\n"):
        assert len({line.count("|") for line in table.splitlines() if line.startswith("|")}) <= 1, table
    parts = f"before\n{FIRST}", "old\n", f"{LAST}after\n"
    assert split_at_block("".join(parts), "file") == parts


FIRST, LAST = MARKERS


def test_a_missing_marker_is_named():
    for text in ("nothing", f"{FIRST}no end", f"{LAST}{FIRST}"):
        assert refusal(split_at_block, text, "notes.md").startswith("notes.md: has no block 'quick'")
