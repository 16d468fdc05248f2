"""A signal that ends the command line: one sentence, its code, no process left. `tests/faults` has more signals."""

import signal
import time

import pytest

from tests.faults.runs import end, family, gone, start

pytestmark = pytest.mark.external  # processes with clusters of dask


def test_a_signal_ends_a_run_with_one_sentence(tmp_path):
    process = start("smoke", tmp_path / "out", verb="generate")
    time.sleep(3.0)
    children = family(process)
    process.send_signal(signal.SIGTERM)
    ended = end(process, timeout=300)
    assert ended.code == 143 and ended.sentence.startswith("stopped") and not gone(children, seconds=300)
