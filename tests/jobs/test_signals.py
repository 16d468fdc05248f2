"""A signal that ends the command line: one sentence, its code, no process left. `tests/faults` has more signals."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

pytestmark = pytest.mark.external  # processes with clusters of dask

ROOT = Path(__file__).parents[2]
START = "import sys; from jobs.entry import main; sys.exit(main())"


def test_a_signal_ends_a_run_with_one_sentence(tmp_path):
    process = subprocess.Popen(
        [sys.executable, "-c", START, "generate", "smoke", "--out", str(tmp_path / "out")],
        cwd=ROOT,
        env=os.environ | {"COLUMNS": "200"},
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
    )
    time.sleep(3.0)
    children = psutil.Process(process.pid).children(recursive=True)
    process.send_signal(signal.SIGTERM)
    _, told = process.communicate(timeout=300)
    assert process.returncode == 143
    assert "Traceback" not in told
    assert told.strip().splitlines()[-1].startswith("stopped")
    _, alive = psutil.wait_procs(children, timeout=300)
    assert not alive
