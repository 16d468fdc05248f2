"""The table of README.md, reports/RESULTS.md, and blocks that a command writes."""

import math

import pytest

from reports.record import Machine, Provenance, Record
from reports.tables.documents import (
    README_METHODS,
    block,
    kept_time,
    markers,
    readme_block,
    results_page,
    two_decimals,
    with_block,
)
from weaves.errors import BadInput

MACHINE = Machine(
    cpu="Test CPU", cores=2, threads=2, system="Linux", python="3.11", packages={"numpy": "2.0"}, date="2026-01-01T12"
)


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
    assert "| two random points, exact shadows | 7.5e−4 | 1× | 1× | 0.15 | 1× |" in block
    assert "| sixteen random points | 9.4e−5 | 8× | 8× | 0.02 | 7.8× |" in block
    assert f"| {README_METHODS['woven', '']} | 1.7e−4 | 4.5× | 4.5× | 0.00 | 4.3× |" in block
    assert "`selvage`" not in block, "a method that was not measured has no row"
    assert (
        "`woven` has 4.5× lower MSE than two points on seen fabrics, 4.5× on unseen ones, at 4.3× their time" in block
    )
    bounded = [one.model_copy(update={"setting": "bounded"}) for one in records if one.method == "woven"]
    both = readme_block([*records, *bounded], MACHINE, "", "file")
    assert f"| {README_METHODS['woven', '']} |" in both and f"| {README_METHODS['woven', 'bounded']} |" in both
    assert "\n`woven` under the energy bound has 4.5× lower MSE" in both and "\n`woven` has" not in both
    assert "Recipe `quick`" in block and "1,200 held-out queries of 2 seen and 1 unseen fabrics" in block


def test_several_unseen_fabrics_have_an_interval(two_unseen):
    """A second unseen fabric on which woven errs four times as much: 4.5 and 1.125 times lower.

    The geometric mean is 2.25, the interval exp(t_{.975, 1} ln(4) / 2) times less and more, t = 12.7062.
    """
    high = 2.25 * math.exp(12.7062 * math.log(4) / 2)
    named = Provenance(recipe="quick")
    block = readme_block([r.model_copy(update={"provenance": named}) for r in two_unseen], MACHINE, "", "file")
    assert f"| {README_METHODS['woven', '']} | 1.7e−4 | 4.5× | 2.2× (0.00034 … {high:,.0f}×) | 0.00 | 4.3× |" in block
    assert "| two random points, exact shadows | 7.5e−4 | 1× | 1× | 0.15 | 1× |" in block
    assert f"| {README_METHODS['neumip', '']} | 1.7e−4 | 4.5× | 4.5× |" in block
    assert "in parentheses its 95 % interval over fabrics" in block


def test_several_trainings_have_their_mean_and_range(three_trainings):
    named = [
        one.model_copy(update={"provenance": one.provenance.model_copy(update={"recipe": "quick"})})
        for one in three_trainings
    ]
    block = readme_block(named, MACHINE, "", "file")
    assert f"| {README_METHODS['woven', '']} | 3.3e−4 | 2.2× [1.5 … 4.5×] | 2.2× [1.5 … 4.5×] | 0.00 | 4.3× |" in block
    # Trained once, on a single unseen fabric: no range, so no number.
    assert f"| {README_METHODS['neumip', '']} | 1.7e−4 | 4.5× | – | 0.03 |" in block
    assert "–: one training, one fabric: no range." in block
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
    assert [two_decimals(value) for value in (-0.004, 0.0, -0.123)] == ["0.00", "0.00", "−0.12"]


def test_records_without_the_baseline_are_refused(records):
    rest = [record for record in records if record.method != "point_sampled"]
    with pytest.raises(BadInput, match="two random points"):
        readme_block(rest, MACHINE, "", "file")


def test_the_file_says_where_its_numbers_come_from(made_up):
    named = Provenance(recipe="standard", recipe_fingerprint="0123456789abcdef" * 4)
    rate = Record(method="truth").of("rate", 4.5e8, 1).model_copy(update={"setting": "everything", "unit": "points/s"})
    page = results_page([r.model_copy(update={"provenance": named}) for r in [*made_up, rate]], MACHINE, "file")
    head = page.partition("## ")[0]
    for words in ("`standard`", "`0123456789abcdef`", "Test CPU, 2 cores", "numpy 2.0", "Measured on 2026-01-01"):
        assert words in head
    assert "| points, k = 16 | 9.38e−5 (0.87 … 1.01)e−4 |" in page.replace("\N{NO-BREAK SPACE}", " ")
    assert "| everything | – | 4.5e+08 points/s |  |" in page
    assert "## Scenes" not in page, "what was not measured has no section"


def test_numbers_of_several_trainings_have_their_range(three_trainings):
    about = {"recipe": "standard"}
    named = [r.model_copy(update={"provenance": r.provenance.model_copy(update=about)}) for r in three_trainings]
    page = results_page(named, MACHINE, "file")
    assert "| woven | 3.33e−4 (3.09 … 3.58)e−4 [1.67 … 5.00]e−4 | 0.3 % | 2.2× (2 … 2.5×) [1.5 … 4.5×] |" in page
    assert "Not shown on the unseen fabric: NeuMIP." in page
    assert "Networks were trained up to 3 times with other seeds." in page
    assert "| woven | −2.00e−3 [−3.00 … −1.00]e−3 |" in page


def test_several_unseen_fabrics_have_a_table_of_means(two_unseen):
    named = [r.model_copy(update={"provenance": Provenance(recipe="standard")}) for r in two_unseen]
    page = results_page(named, MACHINE, "file")
    section = page.partition("### Means over unseen fabrics")[2].partition("##")[0]
    table = "".join(line for line in section.splitlines() if line.startswith("|"))
    assert "| woven | 2.2× (0.00034 … 15," in table and "NeuMIP" not in table


def test_without_two_random_points_there_are_no_ratios(made_up):
    named = Provenance(recipe="standard")
    others = [r.model_copy(update={"provenance": named}) for r in made_up if r.method != "point_sampled"]
    page = results_page(others, MACHINE, "file")
    (line,) = (
        line
        for line in page.partition("### Errors, unseen")[2].partition("##")[0].splitlines()
        if line.startswith("| woven")
    )
    assert [cell.strip() for cell in line.split("|")][4] == "–"
    assert "\n\n\n" not in page, "a section without sentences has no empty paragraph"


def test_every_line_of_a_table_has_as_many_cells(made_up):
    named = Provenance(recipe="standard")
    page = results_page([r.model_copy(update={"provenance": named}) for r in made_up], MACHINE, "file")
    for table in page.split("\n\n"):
        assert len({line.count("|") for line in table.splitlines() if line.startswith("|")}) <= 1, table


def test_records_of_no_recipe_are_refused(made_up):
    with pytest.raises(BadInput, match="names no recipe"):
        results_page(made_up, MACHINE, "file")


FIRST, LAST = markers("speeds")
TEXT = f"before\n{FIRST}\nold\n{LAST}\nafter\n"


def test_a_block_is_replaced_and_nothing_else():
    assert block(TEXT, "speeds", "file") == "old\n"
    assert with_block(TEXT, "speeds", "new\n\n", "file") == f"before\n{FIRST}\nnew\n{LAST}\nafter\n"
    assert with_block(TEXT, "speeds", "old", "file") == TEXT


@pytest.mark.parametrize("text", ["nothing", f"{FIRST}\nno end", f"{LAST}\n{FIRST}\n"])
def test_a_missing_marker_is_named(text):
    with pytest.raises(BadInput, match=r"notes\.md: has no block 'speeds'"):
        block(text, "speeds", "notes.md")
