import pytest

from reports.record import Machine, Provenance, Record
from reports.tables.results import results_page
from weaves.errors import BadInput

MACHINE = Machine(
    cpu="Test CPU", cores=2, threads=2, system="Linux", python="3.11", packages={"numpy": "2.0"}, date="2026-01-01T12"
)


def test_the_file_says_where_its_numbers_come_from(made_up):
    named = Provenance(recipe="standard", recipe_fingerprint="0123456789abcdef" * 4)
    rate = Record(method="truth").of("rate", 4.5e8, 1).model_copy(update={"setting": "everything", "unit": "points/s"})
    page = results_page([r.model_copy(update={"provenance": named}) for r in [*made_up, rate]], MACHINE, "file")
    head = page.partition("## ")[0]
    for said in ("`standard`", "`0123456789abcdef`", "Test CPU, 2 cores", "numpy 2.0", "Measured on 2026-01-01"):
        assert said in head
    assert "| points, k = 16 | 9.38e−5 | 8× |" in page.replace("\N{NO-BREAK SPACE}", " ")
    assert "| everything | – | 4.5e+08 points/s |  |" in page
    assert "## Scenes" not in page, "what was not measured has no section"


def test_numbers_of_several_trainings_have_their_range(three_trainings):
    about = {"recipe": "standard"}
    named = [r.model_copy(update={"provenance": r.provenance.model_copy(update=about)}) for r in three_trainings]
    page = results_page(named, MACHINE, "file")
    assert "| woven | 3.33e−4 [1.67 … 5.00]e−4 | 2.2× [1.5 … 4.5×] |" in page
    assert "means over 3 trainings with different seeds, in brackets the least and the most" in page
    assert "| woven | seen | −0.002 [-0.003 … −0.001] |".replace("-", "−") in page


def test_several_unseen_fabrics_have_an_interval(two_unseen):
    named = [r.model_copy(update={"provenance": Provenance(recipe="standard")}) for r in two_unseen]
    page = results_page(named, MACHINE, "file")
    section = page.partition("### Over unseen fabrics: geometric means")[2].partition("##")[0]
    table = "".join(line for line in section.splitlines() if line.startswith("|"))
    assert "| woven | 2.2× (0.00034 … 15," in table and "NeuMIP" not in table


def test_without_two_random_points_there_are_no_ratios(made_up):
    named = Provenance(recipe="standard")
    others = [r.model_copy(update={"provenance": named}) for r in made_up if r.method != "point_sampled"]
    page = results_page(others, MACHINE, "file")
    (line,) = (
        line for line in page.partition("### Unseen")[2].partition("##")[0].splitlines() if line.startswith("| woven")
    )
    assert [cell.strip() for cell in line.split("|")][3:5] == ["–", "–"]
    assert "\n\n\n" not in page, "a section without sentences has no empty paragraph"


def test_every_line_of_a_table_has_as_many_cells(made_up):
    named = Provenance(recipe="standard")
    page = results_page([r.model_copy(update={"provenance": named}) for r in made_up], MACHINE, "file")
    for table in page.split("\n\n"):
        assert len({line.count("|") for line in table.splitlines() if line.startswith("|")}) <= 1, table


def test_records_of_no_recipe_are_refused(made_up):
    with pytest.raises(BadInput, match="names no recipe"):
        results_page(made_up, MACHINE, "file")
