"""Software that the bytes of results depend on: the driver's, and that of each worker."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Mapping
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


def difference(there: Mapping[str, str] | BaseException) -> str:
    """Return how a worker's software differs from this process's, in words; empty if it does not."""
    if isinstance(there, BaseException):
        return f"it has no twillight of this version ({type(there).__name__})"
    here = software()
    other = [name for name in here if there.get(name) != here[name]]
    words = [f"{name} {there.get(name, 'missing')} (here {here[name]})" for name in other]
    return f"it has {', '.join(words)}" if words else ""


def _sources() -> str:
    """Return a hash of all Python files of the packages, by their paths within them."""
    root = Path(__file__).parents[2]
    found = hashlib.sha256()
    for path in sorted(path for package in _PACKAGES for path in (root / package).rglob("*.py")):
        found.update(f"{path.relative_to(root).as_posix()}\0".encode())
        found.update(hashlib.sha256(path.read_bytes()).digest())
    return found.hexdigest()[:8]
