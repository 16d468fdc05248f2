"""Signals of each kind at five moments: one sentence, the code of the signal, no process left, the same bytes after."""

import signal
import time

import pytest

from tests.faults.runs import end, family, gone, hashes, run, start

pytestmark = pytest.mark.faults

CODES = {"SIGINT": {130, -2, 0}, "SIGTERM": {143, -15, 0}, "SIGHUP": {129, -1, 0}}
"""By signal; negative before the command line is loaded, 0 if the run has ended before."""


@pytest.mark.parametrize("name", CODES)
def test_a_signal_at_five_moments(recipe, undisturbed, tmp_path, name):
    out = tmp_path / "out"
    for wait in (0.1, 0.7, 2.0, 5.0, 9.0):
        process = start(recipe, out)
        time.sleep(wait)
        children = family(process)
        process.send_signal(getattr(signal, name))
        found = end(process, timeout=60.0)
        assert found.code in CODES[name], found
        if found.code > 0:
            found.assert_sentence()
            assert found.stderr.strip().splitlines()[-1].startswith("stopped")
        assert "Traceback" not in found.stderr or found.code < 0
        assert not gone(children)
    found = run(recipe, out)
    assert found.code == 0, found.stderr
    assert hashes(recipe, out) == undisturbed[1]
