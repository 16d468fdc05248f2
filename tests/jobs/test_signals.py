"""A signal that ends the command line: one sentence, its code, no process left. `tests/faults` has more signals."""

import signal
import time
from pathlib import Path

import pytest

from jobs.exits import run_to_exit
from tests.faults.runs import end, family, gone, start


@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 143), (signal.SIGHUP, 129), (signal.SIGINT, 130)])
def test_a_signal_in_a_library_that_hides_it_is_a_stop(number, code, capsys):
    """As pydantic's compiled schemas do: they raise an error of their own, without its cause."""

    def verb():
        try:
            signal.raise_signal(number)
        except KeyboardInterrupt:
            problem = ValueError("Error building validator")
        raise problem

    # A shell starts what runs in the background with Ctrl-C ignored, and so it stays.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        assert run_to_exit(verb, ["run"], Path("out")) == code and capsys.readouterr().err.startswith("stopped")
    finally:
        signal.signal(signal.SIGINT, before)


@pytest.mark.external  # processes with clusters of dask
def test_a_signal_ends_a_run_with_one_sentence(tmp_path):
    process = start("smoke", tmp_path / "out", verb="generate")
    time.sleep(3.0)
    children = family(process)
    process.send_signal(signal.SIGTERM)
    ended = end(process, timeout=300)
    assert ended.code == 143 and ended.sentence.startswith("stopped") and not gone(children, seconds=300)
