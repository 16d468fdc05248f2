"""Places of files: folders of this machine, and addresses of object storage such as ``s3://bucket/prefix``.

An address is a path too: a `upath.UPath` of fsspec, which reads, lists and removes as `pathlib.Path` does. What needs a
file of this machine (Parquet writers, safetensors, pictures) gets a copy from `local_copy` or writes through
`pipeline.atomic`, which stores the whole file at once.

Credentials come from the environment, as each file system of fsspec defines it (``AWS_ACCESS_KEY_ID``, ``AWS_PROFILE``,
``AWS_ENDPOINT_URL``, …). They are no part of an address, of a recipe or of any product.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, cast

from weaves.errors import BadInput, WorkFailed, one_line

_ADDRESS: Final = re.compile(r"([a-z][a-z0-9+.-]+)://(.*)", re.DOTALL)

_OBJECTS: Final = {"s3", "s3a", "gs", "gcs", "az", "abfs", "abfss", "adl", "oss"}
"""Protocols whose files appear when all of their bytes have arrived."""

_PATIENT: Final = {"config_kwargs": {"retries": {"mode": "standard", "max_attempts": 16}}}
_OPTIONS: Final[dict[str, dict[str, Any]]] = {"s3": _PATIENT, "s3a": _PATIENT}
"""Options of file systems: a request that fails is tried again, with growing pauses."""

_LIBRARIES: Final = {"botocore", "aiobotocore", "aiohttp", "s3fs", "gcsfs", "adlfs", "azure", "google", "urllib3"}
"""Packages whose own errors are those of a storage or of the way to it."""


def place(name: str, where: str = "--out") -> Path:
    """Return the path of a folder or file by its name.

    Parameters
    ----------
    name : str
        A path of this machine, or an address ``protocol://...`` of a file system of fsspec.
    where : str
        Option that it was given to, for messages.

    Raises
    ------
    BadInput
        If the protocol is unknown, its package is not installed, or the address has no bucket or has credentials in it.
    """
    match = _ADDRESS.fullmatch(name)
    if match is None:
        return Path(name)
    protocol, rest = match.groups()
    if "@" in rest.split("/")[0]:
        shown = f"{protocol}://…@{rest.split('@', 1)[1]}"
        raise BadInput(where, "", shown, "credentials belong in the environment, never in an address")
    if protocol in ("file", "local"):
        return Path("/" + rest.lstrip("/"))
    if not rest.strip("/"):
        raise BadInput(where, "", name, "an address names at least a bucket, as s3://bucket/prefix")
    from upath import UPath

    try:
        found = UPath(name, use_listings_cache=False, **_OPTIONS.get(protocol, {}))
        found.fs  # noqa: B018, it is made here
    except (ImportError, ValueError) as error:
        allowed = "a folder or an address of fsspec is needed, as s3://bucket/prefix"
        raise BadInput(where, "", name, f"{allowed} ({one_line(error, 80)})") from error
    return cast("Path", found)


def is_local(path: Path) -> bool:
    """Return whether a path is one of this machine."""
    return isinstance(path, Path)


@contextmanager
def local_copy(path: Path) -> Iterator[Path]:
    """Yield a file of this machine with the content of `path`: itself, or a copy that is removed afterwards."""
    if is_local(path):
        yield path
        return
    with tempfile.TemporaryDirectory(prefix="twillight-") as folder:
        copy = Path(folder) / path.name
        fetch(path, copy)
        yield copy


def fetch(path: Path, target: Path) -> None:
    """Copy a file of object storage to this machine."""
    remote: Any = path
    remote.fs.get_file(remote.path, str(target))


def store(source: Path, path: Path) -> None:
    """Copy a file of this machine to object storage, where it appears whole or not at all."""
    remote: Any = path
    if remote.protocol in _OBJECTS:
        remote.fs.put_file(str(source), remote.path)
        return
    remote.parent.mkdir(parents=True, exist_ok=True)
    temporary = remote.with_name(f".tmp-{remote.name}")
    remote.fs.put_file(str(source), temporary.path)
    remote.fs.mv(temporary.path, remote.path)


def copy(source: Path, target: Path) -> None:
    """Copy a file within object storage."""
    remote: Any = source
    remote.fs.cp_file(remote.path, cast("Any", target).path)


def explained(error: BaseException) -> BadInput | WorkFailed | None:
    """Return an error of a storage as a sentence; None if it is another error."""
    if type(error).__module__.split(".")[0] not in _LIBRARIES and not _from_library(error):
        return None
    reason = one_line(error, 120)
    if isinstance(error, PermissionError):
        return BadInput("--out", "", "refused", f"credentials of the environment that may read and write ({reason})")
    if isinstance(error, FileNotFoundError):
        return BadInput("--out", "", "not found", f"an existing bucket is needed ({reason})")
    return WorkFailed(f"--out: the storage fails ({reason}); finished work is kept, and the same command continues")


def _from_library(error: BaseException) -> bool:
    """Return whether an error of Python's own kinds was raised on behalf of a storage library."""
    cause = error.__cause__ or error.__context__
    return cause is not None and type(cause).__module__.split(".")[0] in _LIBRARIES
