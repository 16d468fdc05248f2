"""A signal in a library; tests/faults/test_disturbed_runs.py has signals to whole runs."""

import signal
from pathlib import Path

import pytest

from jobs.exits import run_to_exit


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
        for tokens, kept in ((["run", "quick"], True), (["view", "denim"], False), ([], False)):
            assert run_to_exit(verb, tokens, Path("out")) == code
            told = capsys.readouterr().err
            assert told.startswith("stopped") and ("the same command continues" in told) == kept
    finally:
        signal.signal(signal.SIGINT, before)
