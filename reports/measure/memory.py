"""Peak memory of a call, including that of NumPy, torch and compiled kernels.

Linux keeps the largest resident size of a process and lets it be reset. Freed memory is handed back to the system
first, because the call could reuse it unseen. The result is the growth of the largest resident size during the call. In
an old process some pages are not handed back, and pages that Python touches again count too: a result below `UNSURE`
only means that it is small. Memory of a GPU is not part of it.
"""

import ctypes
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Final

UNSURE: Final = 16_000_000  # bytes by which an answer may be wrong: 10 MB were seen


def peak_memory(call: Callable[[], object]) -> float | None:
    """Return the bytes that a call adds to the process at most: the median of three calls, after one to warm up.

    None where the system does not report it: on all systems but Linux with glibc.
    """
    call()
    added = []
    for _ in range(3):
        if not _start_anew():
            return None
        before = _kilobytes("VmRSS")
        call()
        added.append(1024.0 * max(0, _kilobytes("VmHWM") - before))
    return median(added)


def _start_anew() -> bool:
    """Hand freed memory back and forget the largest size so far; False where that cannot be done."""
    try:
        ctypes.CDLL(None).malloc_trim(0)
        Path("/proc/self/clear_refs").write_text("5")  # see proc(5)
    except (OSError, AttributeError, TypeError):
        return False
    return True


def _kilobytes(key: str) -> int:
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(f"{key}:"))
