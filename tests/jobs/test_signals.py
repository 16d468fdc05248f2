"""Signals that end the command line: one sentence, the code of the signal, no process left."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

ROOT = Path(__file__).parents[2]
START = "import sys; from jobs.entry import main; sys.exit(main())"


@pytest.mark.parametrize(
    ("number", "codes", "wait"),
    [("SIGINT", {130, -2}, 0.2), ("SIGTERM", {143}, 3.0), ("SIGHUP", {129, -1}, 1.0)],
)
def test_a_signal_ends_a_run_with_one_sentence(tmp_path, number, codes, wait):
    """In the first moments, before the command line is loaded, a signal may end Python itself."""
    process = subprocess.Popen(
        [sys.executable, "-c", START, "generate", "smoke", "--out", str(tmp_path / "out")],
        cwd=ROOT,
        env=os.environ | {"COLUMNS": "200"},
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    time.sleep(wait)
    children = psutil.Process(process.pid).children(recursive=True)
    process.send_signal(getattr(signal, number))
    _, told = process.communicate(timeout=60)
    assert process.returncode in codes
    assert "Traceback" not in told
    if process.returncode > 0:
        assert told.strip().splitlines()[-1].startswith("stopped")
    _, alive = psutil.wait_procs(children, timeout=15)
    assert not alive
