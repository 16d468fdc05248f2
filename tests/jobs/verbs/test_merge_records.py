import pytest

from jobs.cli import main
from reports.record import Record, read_machine, read_records, this_machine, write_records

MSE = Record(method="woven", metric="mse", value=2.0)
TIME = Record(method="woven", metric="time", value=50.0, unit="ns/query", threads=1)


@pytest.fixture
def files(tmp_path):
    """Two files of Records, of machines with 2 and 64 cores."""
    machine, paths = this_machine(1), []
    for cores, time in ((2, 50.0), (64, 20.0)):
        path = tmp_path / f"{cores}.json"
        records = [MSE, TIME.model_copy(update={"value": time})]
        write_records(path, records, machine.model_copy(update={"cores": cores}))
        paths.append(str(path))
    return paths


def test_records_of_two_machines_are_joined_and_shown(files, tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    out = tmp_path / "all.json"
    assert main(["records", "merge", *files, "--out", str(out)]) == 0, capsys.readouterr().err
    records = read_records([out])
    assert [(one.metric, one.value) for one in records] == [("mse", 2.0), ("time", 50.0), ("time", 20.0)]
    assert "2 cores" in records[1].provenance.machine and "64 cores" in records[2].provenance.machine
    assert "2 cores" in read_machine(out).cpu and "64 cores" in read_machine(out).cpu
    said = capsys.readouterr().out
    assert "woven" in said and "50" in said and "20" in said and "3 Records of 2 machines; 1 are alike" in said
    assert main(["compare", str(out), files[0]]) == 2
    assert "holds Records of several machines" in capsys.readouterr().err
