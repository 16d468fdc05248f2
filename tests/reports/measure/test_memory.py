import subprocess
import sys
from pathlib import Path

import pytest

from reports.measure.memory import UNSURE, peak_memory

ROOT = Path(__file__).parents[3]
MB = 2**20

needs_linux = pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells")


def peak_in_own_process(call: str) -> float:
    """Return what `peak_memory` says of a function `call` in a process that holds nothing else, in bytes."""
    script = f"import numpy as np\nfrom reports.measure.memory import peak_memory\n{call}\nprint(peak_memory(call))"
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
    return float(done.stdout)


TWO_OF_THREE = """
def call():
    one = np.ones({size}, np.uint8)
    other = np.ones({size}, np.uint8)
    del one
    return other.sum() + np.ones({size} // 2, np.uint8).sum()
"""

TORCH = """
import torch
def call():
    torch.ones(32 * 2**20, dtype=torch.uint8)
"""


@needs_linux
@pytest.mark.parametrize("size", [64 * MB, 256 * MB])
def test_what_a_call_holds_at_once_is_counted_and_what_it_held_before_is_not(size):
    """Three arrays of which two live together: twice the size of one, within a tenth and what is stated as unsure."""
    assert peak_in_own_process(TWO_OF_THREE.format(size=size)) == pytest.approx(2 * size, rel=0.1, abs=UNSURE)


@needs_linux
@pytest.mark.slow
def test_torch_is_counted_too():
    assert peak_in_own_process(TORCH) == pytest.approx(32 * MB, abs=UNSURE)


def test_a_system_that_does_not_tell_gives_none(monkeypatch):
    monkeypatch.setattr("reports.measure.memory._start_anew", lambda: False)
    assert peak_memory(lambda: None) is None


def test_what_the_call_raises_is_raised():
    def call():
        raise ValueError("mine")

    with pytest.raises(ValueError, match="mine"):
        peak_memory(call)
