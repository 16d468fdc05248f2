import pytest

from jobs.verbs.records import join, names_of, refuse_several
from reports.record import Provenance, Record, this_machine
from tests.refusals import refusal

MSE = Record(method="woven", metric="mse", value=2.0, provenance=Provenance(recipe="one", dataset="d"))
TIME = Record(method="woven", metric="time", value=50.0, unit="ns/query", threads=1, samples=(49.0, 50.0, 51.0))


def of(machine, record):
    return record.model_copy(update={"provenance": record.provenance.model_copy(update={"machine": machine})})


def test_times_stay_apart_equal_numbers_are_kept_once_and_equal_machines_are_numbered():
    other = MSE.model_copy(update={"provenance": Provenance(recipe="two", dataset="d")})
    joined = join({"A": [MSE, TIME], "B": [other, TIME], "C": [TIME]})
    assert joined == ([MSE, of("A", TIME), of("B", TIME), of("C", TIME)], 1, [])
    other = MSE.model_copy(update={"value": 2.5})
    assert join({"A": [MSE], "B": [other]}) == ([MSE, of("B", other)], 0, [(MSE, other)])
    machine = this_machine(1)
    names = names_of([machine, machine.model_copy(update={"cores": machine.cores + 1}), machine])
    assert len(set(names)) == 3 and names[0].endswith("(1)") and names[2].endswith("(2)")
    assert machine.cpu in names[1] and f"{machine.cores + 1} cores" in names[1]
    records, _, _ = join({"A": [MSE, TIME], "B": [TIME]})
    assert refusal(refuse_several, records, "file").startswith("file: holds Records of several machines")
    assert refusal(join, {"C": records}).startswith("C: holds")


@pytest.mark.parametrize(
    "change", [{"fabric": "denim"}, {"setting": "k = 2"}, {"provenance": Provenance(dataset="e")}, {"threads": 2}]
)
def test_numbers_of_other_subjects_are_no_pair(change):
    other = MSE.model_copy(update=change)
    assert join({"A": [MSE], "B": [other]})[0] == [MSE, other]
