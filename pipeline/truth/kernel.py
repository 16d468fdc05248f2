"""How kernels are compiled: single-threaded, without the GIL, cached on disk under a name that follows their sources.

numba notices a changed file but not a changed file that it calls into; a cache folder named after all sources of this
package cannot serve a stale kernel. No fast-math but where a kernel says so (`fast_kernel`).
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import numba

_PACKAGE = Path(__file__).parent


def _cache_folder() -> Path:
    """Return the folder for compiled kernels: in the package's own ``__pycache__``, else in the user's cache."""
    sources = hashlib.sha256(b"".join(path.read_bytes() for path in sorted(_PACKAGE.rglob("*.py"))))
    folder = f"kernels-{sources.hexdigest()[:12]}"
    if os.access(_PACKAGE, os.W_OK):
        return _PACKAGE / "__pycache__" / folder
    return Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "twillight" / folder


numba.config.CACHE_DIR = str(_cache_folder())  # type: ignore[attr-defined]

kernel = numba.njit(cache=True, nogil=True, error_model="numpy")
"""Decorator of every compiled function of the ground truth."""

_REGROUPED = {"reassoc", "contract", "nsz", "arcp"}

fast_kernel = numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=_REGROUPED)
"""Decorator of the few flat loops in single precision that vector units must be free to sum in their own order.

NaN and infinity keep their meaning. Sums differ in the last bits between processors of different vector width, never
between runs, workers or orders on one.
"""

inlined_kernel = numba.njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
"""Decorator of functions called once a point with many tables: a call would copy what it passes."""

inlined_fast_kernel = numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=_REGROUPED, forceinline=True)
"""Decorator of what such a loop calls for every node: a call would keep it from the vector units."""
