import sys

import numpy as np
import pytest

from reports.measure.memory import UNSURE, peak_memory

MB = 2**20

needs_linux = pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells")


@needs_linux
@pytest.mark.parametrize("size", [64, 256])
def test_what_a_call_holds_at_once_is_counted_and_what_it_held_before_is_not(size):
    """Three arrays of which two live together: twice the size of one, within a tenth and what is stated as unsure."""

    def call():
        one = np.ones(size * MB, np.uint8)
        other = np.ones(size * MB, np.uint8)
        del one
        return other.sum() + np.ones(size * MB // 2, np.uint8).sum()

    assert peak_memory(call) == pytest.approx(2 * size * MB, rel=0.1, abs=UNSURE)


@needs_linux
def test_torch_is_counted_too():
    torch = pytest.importorskip("torch")
    assert peak_memory(lambda: torch.ones(32 * MB, dtype=torch.uint8)) == pytest.approx(32 * MB, abs=UNSURE)


def test_a_system_that_does_not_tell_gives_none(monkeypatch):
    monkeypatch.setattr("reports.measure.memory._start_anew", lambda: False)
    assert peak_memory(lambda: None) is None


def test_what_the_call_raises_is_raised():
    def call():
        raise ValueError("mine")

    with pytest.raises(ValueError, match="mine"):
        peak_memory(call)
