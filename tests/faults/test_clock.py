"""A clock that is off changes no byte and makes nothing again."""

import os
import time

import pytest

from tests.faults.runs import end, hashes, run, start

pytestmark = pytest.mark.faults

YEAR = 365.25 * 86400.0
SHIFT = """
import os, time
_shift, _time, _time_ns = float(os.environ["CLOCK_SHIFT"]), time.time, time.time_ns
time.time = lambda: _time() + _shift
time.time_ns = lambda: _time_ns() + int(_shift * 1e9)
"""


@pytest.mark.parametrize("shift", [3600.0, -3600.0, 50.0 * YEAR, -50.0 * YEAR])
def test_a_clock_that_is_off(recipe, undisturbed, tmp_path, shift):
    """Half of a run with a clock that is off, files dated by it, the rest and a further run with the right clock."""
    (tmp_path / "sitecustomize.py").write_text(SHIFT)
    out = tmp_path / "out"
    search = os.pathsep.join(filter(None, [str(tmp_path), os.environ.get("PYTHONPATH", "")]))
    found = end(start(recipe, out, verb="generate", env={"PYTHONPATH": search, "CLOCK_SHIFT": str(shift)}))
    assert found.code == 0, found.stderr
    date = time.time() + shift
    for path in out.rglob("*"):
        os.utime(path, (date, date))
    before = {path: path.stat().st_ino for path in out.glob("datasets/*/*.parquet")}
    found = run(recipe, out)
    assert found.code == 0, found.stderr
    assert hashes(recipe, out) == undisturbed[1]
    assert {path: path.stat().st_ino for path in out.glob("datasets/*/*.parquet")} == before
