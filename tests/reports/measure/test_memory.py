import subprocess
import sys

import pytest

from reports.measure.memory import UNSURE, peak_memory

SIZE = 48 * 2**20
SCRIPT = f"""
import numpy as np
from reports.measure.memory import peak_memory

def call():
    one = np.ones({SIZE}, np.uint8)
    other = np.ones({SIZE}, np.uint8)
    del one
    return other.sum() + np.ones({SIZE} // 2, np.uint8).sum()

print(peak_memory(call))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells")
def test_what_a_call_holds_at_once_is_counted_and_what_it_held_before_is_not():
    """Twice the size, within a tenth and what is stated as unsure, in a process that holds nothing else."""
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True)
    assert float(done.stdout) == pytest.approx(2 * SIZE, rel=0.1, abs=UNSURE)


def test_a_system_that_does_not_tell_gives_none(monkeypatch):
    monkeypatch.setattr("reports.measure.memory._start_anew", lambda: False)
    assert peak_memory(lambda: None) is None
