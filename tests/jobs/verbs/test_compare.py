"""`twillight compare`: where it finds Records, what it prints, what it refuses."""

import pytest

from reports.record import OF_A_PAGE, Record, machine_path, this_machine, write_records


def records(time, mse, samples=25):
    readings = tuple(time * (1 + 1e-3 * index) for index in range(samples))
    cost = Record(method="woven", threads=1).of("time", time, samples, samples=readings)
    error = Record(method="woven", fabric="denim", role="seen", scene="queries")
    return [cost, error.of("mse", mse, 400, standard_error=mse / 20)]


@pytest.fixture
def write(tmp_path):
    """Write a page's Records into a folder of products; return that folder."""

    def of(name, time=400.0, mse=1e-4, recipe="quick", **machine):
        folder = tmp_path / name / "report" / recipe
        folder.mkdir(parents=True, exist_ok=True)
        write_records(folder / OF_A_PAGE, records(time, mse), this_machine(1).model_copy(update=machine))
        return tmp_path / name

    return of


@pytest.fixture
def compare(twillight):
    def call(*tokens):
        code, text, told = twillight("compare", *tokens)
        return code, " ".join(text.split()), told

    return call


def test_what_differs_is_marked(compare, write):
    """Times 50 % apart differ, errors of equal size do not; either way of naming the Records will do."""
    a, b = write("a"), write("b", time=600.0)
    code, text, _ = compare(a, b)
    assert code == 0
    assert "woven a query, 1 thread 400 ns 600 ns 1.5 < .001 slower" in text
    assert "woven denim 1.00e-04 ± 9.8e-06 1.00e-04 ± 9.8e-06 1 1 no difference shown" in text
    assert "1 of 2 measurements differ" in text
    page = "report/quick"
    assert compare(a / page, b / page / OF_A_PAGE)[1] == text
    assert "faster" in compare(b, a)[1]


def test_other_machines_are_refused_unless_asked_for(compare, write):
    a, b = write("a"), write("b", cpu="another")
    code, text, told = compare(a, b)
    assert (code, text) == (2, "") and told.count("\n") == 1
    assert "another" in told and "--other-machine" in told
    code, text, _ = compare(a, b, "--other-machine")
    assert code == 0 and "different machines: cpu" in text


def test_of_several_pages_one_is_chosen(compare, write):
    a, b = write("a"), write("b")
    write("b", recipe="smoke", time=900.0)
    code, _, told = compare(a, b)
    assert code == 2 and told.count("\n") == 1 and "--recipe: quick, smoke" in told
    code, text, _ = compare(a, b, "--recipe", "quick")
    assert code == 0 and "0 of 2 measurements differ" in text


def test_what_is_not_there_is_one_sentence(compare, write, tmp_path):
    a = write("a")
    (tmp_path / "empty").mkdir()
    (tmp_path / "broken.json").write_text("[1]")
    (tmp_path / "old.json").write_text('[{"method": "woven", "metric": "mean_error", "value": 1.0}]')
    lone = write("lone") / "report/quick" / OF_A_PAGE
    machine_path(lone).unlink()
    for other, words in (
        (tmp_path / "missing", "does not exist"),
        (tmp_path / "empty", "holds no page"),
        (tmp_path / "broken.json", "holds no records"),
        (tmp_path / "old.json", "of this version (0.metric: 'mean_error' is no metric of reports.catalogue)"),
        (lone, "missing or damaged"),
    ):
        for pair in ((a, other), (other, a)):
            code, text, told = compare(*pair)
            assert (code, text) == (2, "") and told.count("\n") == 1 and words in told, told
    code, _, told = compare(a, a, "--recipe", "quik")
    assert code == 2 and "no page of the recipe quik" in told
