import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from reports.record import Provenance, Record, machine_path, read_machine, read_records, this_machine, write_records
from tests.refusals import refusal

MADE = Provenance(recipe="quick", dataset="0123456789abcdef")
SUBJECT = Record(method="point_sampled", setting="k = 2", fabric="denim", role="seen", scene="queries", provenance=MADE)
RECORDS = [
    SUBJECT.of("mse", 1.25e-3, 4096, standard_error=1e-5, low=1.2e-3, high=1.3e-3),
    SUBJECT.of("flicker", -0.125, 8),
    SUBJECT.of("spectrum", 0.5, 8, curve=((0.1, 1.0), (0.2, 0.25))),
    SUBJECT.of("mse", 0.0, 1),
    SUBJECT.model_copy(update={"threads": 2}).of("time", 1.5, 2, samples=(1.0, 2.0)),
]


def test_records_come_back_as_they_were_with_bytes_of_no_machine_or_date(tmp_path):
    write_records(tmp_path / "a.json", RECORDS, this_machine(1))
    write_records(tmp_path / "b.json", RECORDS[:1], this_machine(1))
    assert read_records([tmp_path / "a.json", tmp_path / "b.json"]) == RECORDS + RECORDS[:1]
    machine = read_machine(tmp_path / "a.json")
    assert machine.threads == 1 and machine.cpu and {"numpy", "torch", "numba"} <= set(machine.packages)
    other = this_machine(1).model_copy(update={"cpu": "another", "date": "2000-01-01T00:00:00+00:00"})
    write_records(tmp_path / "a.json", RECORDS, this_machine(1))
    write_records(tmp_path / "b.json", RECORDS, other)
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()
    assert machine_path(tmp_path / "a.json").read_bytes() != machine_path(tmp_path / "b.json").read_bytes()


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A file of Records, and the bytes of it and of the machine beside it."""
    path = tmp_path_factory.mktemp("flips") / "a.json"
    write_records(path, RECORDS, this_machine(1))
    return path, {file: file.read_bytes() for file in (path, machine_path(path))}


@given(st.data())
def test_every_flip_of_records_or_of_their_machine_is_refused(written, data):
    path, files = written
    struck = data.draw(st.sampled_from(list(files)))
    content = bytearray(files[struck])
    content[data.draw(st.integers(0, len(content) - 1))] ^= data.draw(st.integers(1, 255))
    struck.write_bytes(content)
    refusal(read_records, [path])
    refusal(read_machine, path)
    struck.write_bytes(files[struck])


def test_records_of_before_hashes_are_read(tmp_path):
    write_records(tmp_path / "a.json", RECORDS, this_machine(1))
    beside = machine_path(tmp_path / "a.json")
    content = json.loads(beside.read_text())
    del content["sha256"]
    beside.write_text(json.dumps(content))
    assert read_records([tmp_path / "a.json"]) == RECORDS and read_machine(tmp_path / "a.json").threads == 1


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_numbers_are_finite(value):
    with pytest.raises(ValidationError):
        SUBJECT.of("mse", value, 1)


BEAUTY = b'[{"metric": "beauty", "value": 1, "method": "x"}]'  # no metric of the catalogue


@pytest.mark.parametrize("content", [None, b"", b"{}", b"[1]", BEAUTY])
def test_what_holds_no_records_is_bad_input(tmp_path, content):
    if content is not None:
        (tmp_path / "a.json").write_bytes(content)
    refusal(read_records, [tmp_path / "a.json"])
