import pytest

from pipeline.truth.conventions import COMPONENTS
from reports import record
from reports.record import OF_A_PAGE, Provenance, Record, read_records, this_machine, write_records
from reports.tables.documents import MARKERS


@pytest.fixture
def write(tmp_path):
    """Write a page's Records into a folder of products; return that folder."""

    def of(name, time=400.0, recipe="quick", **machine):
        path = tmp_path / name / "report" / recipe / OF_A_PAGE
        path.parent.mkdir(parents=True, exist_ok=True)
        readings = tuple(time * (1 + 1e-3 * index) for index in range(25))
        cost = Record(method="woven", threads=1).of("time", time, 25, samples=readings)
        error = Record(method="woven", fabric="denim", role="seen", scene="queries")
        records = [error.of("mse", 1e-4, 400, standard_error=5e-6), cost]
        write_records(path, records, this_machine(1).model_copy(update=machine))
        return tmp_path / name

    return of


def test_what_differs_is_marked(call, write):
    """Times 50 % apart differ, errors of equal size do not; either way of naming the Records will do."""
    a, b = write("a"), write("b", time=600.0)
    code, text, _ = call("compare", a, b)
    assert code == 0 and "woven a query, 1 thread 400 ns 600 ns 1.5 < .001 slower" in text
    assert "woven denim 1.00e-04 ± 9.8e-06 1.00e-04 ± 9.8e-06 1 1 no difference shown" in text
    assert "1 of 2 measurements differ" in text
    page = "report/quick"
    assert call("compare", a / page, b / page / OF_A_PAGE)[1] == text and "faster" in call("compare", b, a)[1]


def test_other_machines_are_refused_unless_asked_for_and_of_several_pages_one_is_chosen(call, write, refused):
    a, b = write("a"), write("b", cpu="another")
    code, text, told = call("compare", a, b)
    assert (code, text) == (2, "") and told.count("\n") == 1 and "another" in told and "--other-machine" in told
    code, text, _ = call("compare", a, b, "--other-machine")
    assert code == 0 and "different machines: cpu" in text
    a, b = write("a"), write("b")
    write("b", recipe="smoke", time=900.0)
    assert "--recipe: quick, smoke" in refused("compare", a, b)
    code, text, _ = call("compare", a, b, "--recipe", "quick")
    assert code == 0 and "0 of 2 measurements differ" in text


def test_records_of_two_machines_are_joined_and_shown(call, refused, write, tmp_path):
    pages, out = [write("a", time=50.0, cores=2), write("b", time=20.0, cores=64)], tmp_path / "all.json"
    code, text, told = call("records", "merge", *pages, "--out", out)
    assert code == 0, told
    records = read_records([out])
    assert [(one.metric, one.value) for one in records] == [("mse", 1e-4), ("time", 50.0), ("time", 20.0)]
    for words in ("2 cores", "64 cores"):
        assert any(words in one.provenance.machine for one in records) and words in record.read_machine(out).cpu
    assert "woven 50 20" in text and "3 Records of 2 machines; 1 are alike" in text
    assert "holds Records of several machines" in refused("compare", out, pages[0])


@pytest.fixture
def results(twillight, tmp_path):
    subject = Record(method="point_sampled", setting="k = 2", provenance=Provenance(recipe="smoke"))
    records = [subject.of("time", 500.0, 25, low=490.0, high=510.0), subject.of("bytes_stored", 2000.0, 2)]
    for fabric, role in (("denim", "seen"), ("twill_4_4", "unseen")):
        queries = subject.model_copy(update={"fabric": fabric, "role": role, "scene": "queries"})
        records.append(queries.of("mse", 1e-3, 400, standard_error=1e-5))
        values = {"mse_measured": 1e-3, "truth_noise": 1e-6, "colour_rrmse": 0.3, "zero_answers": 0.0}
        values |= {f"rrmse_{name}": 1e-3 for name in COMPONENTS}
        records += [queries.of(metric, value, 400) for metric, value in values.items()]
        plane = queries.model_copy(update={"scene": "plane"})
        records += [plane.of(metric, 0.5, 3) for metric in ("flicker", "excess_energy")]
    write_records(tmp_path / "out" / "report" / "smoke" / OF_A_PAGE, records, this_machine(1))
    return lambda *more: twillight("results", "smoke", *more)


def test_only_the_block_of_a_readme_is_written_or_tables_beside_the_page_or_where_it_is_said(results, tmp_path):
    first, last = MARKERS
    file = tmp_path / "README.md"
    file.write_text(f"title\n{first}{last}end\n", encoding="utf-8")
    assert results("--readme", file)[0] == 0
    text = file.read_text(encoding="utf-8")
    assert text.startswith(f"title\n{first}| method | MSE") and text.endswith(f"{last}end\n")
    assert not (tmp_path / "out" / "report" / "smoke" / "results.md").exists()
    code, said, _ = results("--readme", file)
    assert code == 0 and "unchanged" in said and file.read_text(encoding="utf-8") == text
    assert results()[0] == results("--file", "R.md")[0] == 0
    beside = (tmp_path / "out" / "report" / "smoke" / "results.md").read_text(encoding="utf-8")
    assert beside == (tmp_path / "R.md").read_text(encoding="utf-8")
    assert beside.startswith("# Results of the recipe `smoke`")
