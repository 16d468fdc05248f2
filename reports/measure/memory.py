"""The memory a call needs while it runs, whoever allocates it: NumPy, torch and compiled kernels alike.

Linux keeps the largest resident size of a process and lets it be reset. Freed memory is handed back to the system
first, or the call would fill it again unseen; what it then adds to the resident size at its largest is the answer. Of a
process that has lived long not every page comes back, and what Python touches anew counts as well: numbers below
`UNSURE` say no more than that they are small. Memory of a GPU is not part of it.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Final

UNSURE: Final = 16_000_000
"""Bytes by which an answer may be wrong: 10 MB were seen."""

_RESET_LARGEST = "5"  # see proc(5), clear_refs


def peak_memory(call: Callable[[], object], repeats: int = 3) -> float | None:
    """Return the bytes that a call adds to the process at most: the median of some calls, after one to warm up.

    None where the system does not tell: elsewhere than on Linux with glibc.
    """
    call()
    added = []
    for _ in range(repeats):
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
        Path("/proc/self/clear_refs").write_text(_RESET_LARGEST)
    except (OSError, AttributeError, TypeError):
        return False
    return True


def _kilobytes(key: str) -> int:
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(f"{key}:"))
