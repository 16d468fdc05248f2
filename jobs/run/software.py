"""Software that the bytes of results depend on: the driver's, and that of each worker."""

from __future__ import annotations

import hashlib
import platform
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Final

_PACKAGES: Final = ("weaves", "pipeline", "reports", "jobs")
_LIBRARIES: Final = ("numba", "numpy", "torch")


@cache
def software() -> dict[str, str]:
    """Return the versions of this process: the hash of twillight's sources, Python, and the libraries that compute.

    Builds of PyTorch for different devices (``+cpu``, ``+cu126``) count as one version.
    """
    python = ".".join(platform.python_version_tuple()[:2])
    libraries = {name: metadata.version(name).partition("+")[0] for name in _LIBRARIES}
    return {"twillight's sources": _sources(), "Python": python, **libraries}


def _sources() -> str:
    """Return a hash of all Python files of the packages, by their paths within them."""
    root = Path(__file__).parents[2]
    digest = hashlib.sha256()
    for path in sorted(path for package in _PACKAGES for path in (root / package).rglob("*.py")):
        digest.update(f"{path.relative_to(root).as_posix()}\0".encode())
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()[:8]
