"""Places of files: folders of this machine, and addresses of object storage such as ``s3://bucket/prefix``.

An address is a path too: a `upath.UPath` of fsspec, which reads, lists and removes as `pathlib.Path` does. What needs a
file of this machine (Parquet writers, safetensors, pictures) gets a copy from `local_copy` or writes through
`pipeline.atomic`, which stores the whole file at once.

Credentials come from the environment, as each file system of fsspec defines it (``AWS_ACCESS_KEY_ID``, ``AWS_PROFILE``,
``AWS_ENDPOINT_URL``, …). They are no part of an address, of a recipe or of any product.
"""

import os
import re
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple, cast

from pipeline.fingerprint import fingerprint
from pipeline.patience import Failure, patiently
from weaves.errors import BadInput, WorkFailed, one_line

Remote = Any
"""A path of object storage, `upath.UPath`, which type checkers do not know."""

_ADDRESS: Final = re.compile(r"([a-z][a-z0-9+.-]+)://(.*)", re.DOTALL)

_OBJECTS: Final = {"s3", "s3a", "gs", "gcs", "az", "abfs", "abfss", "adl", "oss"}
"""Protocols whose files appear when all of their bytes have arrived."""

_ONE_TRY: Final[dict[str, Any]] = {"config_kwargs": {"retries": {"mode": "standard", "total_max_attempts": 1}}}
"""Options of S3: requests are repeated by `pipeline.patience` alone."""

_AT_ONCE: Final = 32  # files that are fetched at the same time
_AT_MOST_REMOVED: Final = 1000  # files in a request

_LIBRARIES: Final = {"botocore", "aiobotocore", "aiohttp", "s3fs", "gcsfs", "adlfs", "azure", "google", "urllib3"}
"""Packages whose own errors are those of a storage or of the way to it."""


def place(name: str, where: str = "--out") -> Path:
    """Return the path of a folder or file: one of this machine, or an address ``protocol://...`` of fsspec.

    BadInput, which names the option `where` it was given, if the protocol is unknown, its package is not installed, or
    the address has no bucket or has credentials in it.
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
        if is_s3 := protocol in ("s3", "s3a"):
            _register_patient_s3()
        found = UPath(name, use_listings_cache=False, **(_ONE_TRY if is_s3 else {}))
        found.fs  # noqa: B018, it is made here
    except (ImportError, ValueError, TypeError, OSError) as error:  # such as zip://, which needs a file
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


def fetch(path: Remote, target: Path) -> None:
    """Copy a file of object storage to this machine."""
    path.fs.get_file(path.path, str(target))


def workspace(out: Path) -> Path:
    """Return the folder of this machine and user for an address, made if it is missing; BadInput if it cannot be."""
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    folder = cache / "twillight" / fingerprint(str(out))
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:  # no folder of all users instead: a stranger may have put files there
        allowed = "XDG_CACHE_HOME must name a folder that can be written"
        raise BadInput(str(cache), "", error.strerror or error, allowed) from error
    return folder


class Stored(NamedTuple):
    """A file of object storage: its size in bytes, and a version that changes whenever it is written."""

    bytes: int
    version: str


def listing(folder: Remote) -> dict[str, Stored]:
    """Return all files below a folder of object storage, by path relative to it; FileNotFoundError without bucket."""
    root = folder.path.rstrip("/") + "/"
    found = folder.fs.find(root, detail=True)
    return {
        path.removeprefix(root): Stored(int(about["size"]), fingerprint(sorted(map(str, about.items()))))
        for path, about in found.items()
        if about["type"] == "file" and path.startswith(root) and path != root
    }


def size_of(path: Remote) -> int:
    """Return the size of a file in bytes; FileNotFoundError if there is none."""
    return int(path.stat().st_size if is_local(path) else path.fs.info(path.path)["size"])


def fetch_all(root: Remote, targets: Mapping[str, Path]) -> None:
    """Copy files of object storage, given by paths relative to `root`, to this machine, many at the same time."""
    if targets:
        sources = [(root / path).path for path in targets]
        root.fs.get(sources, [str(target) for target in targets.values()], batch_size=_AT_ONCE)


def remove_all(root: Remote, paths: Sequence[str]) -> None:
    """Remove files of object storage, given by paths relative to `root`, in this order; S3 removes 1000 a request."""
    for start in range(0, len(paths), _AT_MOST_REMOVED):
        root.fs.rm([(root / path).path for path in paths[start : start + _AT_MOST_REMOVED]])


def store(source: Path, path: Remote) -> None:
    """Copy a file of this machine to object storage, where it appears whole or not at all."""
    if path.protocol in _OBJECTS:
        path.fs.put_file(str(source), path.path)
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".tmp-{path.name}")
    path.fs.put_file(str(source), temporary.path)
    path.fs.mv(temporary.path, path.path)


def copy(source: Remote, target: Remote) -> None:
    """Copy a file within object storage."""
    source.fs.cp_file(source.path, target.path)


def explained(error: BaseException) -> BadInput | WorkFailed | None:
    """Return an error of a storage as a sentence; None if it is another error."""
    # Errors of Python's own kinds may be raised on behalf of a library.
    raised = error, error.__cause__ or error.__context__
    if _LIBRARIES.isdisjoint(type(each).__module__.split(".")[0] for each in raised):
        return None
    reason = one_line(error, 120)
    if isinstance(error, PermissionError):
        return BadInput("--out", "", "refused", f"credentials of the environment that may read and write ({reason})")
    if isinstance(error, FileNotFoundError) and "bucket" in reason.lower():
        return BadInput("--out", "", "not found", f"an existing bucket is needed ({reason})")
    return WorkFailed(f"--out: the storage fails ({reason}); finished work is kept, and the same command continues")


@cache
def _register_patient_s3() -> None:
    """Let fsspec use, for S3, a file system that repeats requests which fail."""
    from fsspec import register_implementation
    from s3fs import S3FileSystem

    class PatientS3(S3FileSystem):  # type: ignore[misc]
        retries = 2  # of s3fs itself, also within the body of an answer

        async def _call_s3(self, method: str, *options: Any, **arguments: Any) -> Any:
            return await patiently(lambda: S3FileSystem._call_s3(self, method, *options, **arguments), _kind_of)

    register_implementation("s3", PatientS3, clobber=True)
    register_implementation("s3a", PatientS3, clobber=True)


def _kind_of(error: Exception) -> Failure:
    """Return whether an error of s3fs is an answer after which to try again, no answer, or final."""
    import botocore.exceptions
    from s3fs.core import S3_RETRYABLE_ERRORS

    response = getattr(error, "response", None) or getattr(error.__cause__, "response", None)
    if isinstance(response, dict):
        status = int(response.get("ResponseMetadata", {}).get("HTTPStatusCode", 0))
        code = str(response.get("Error", {}).get("Code", ""))
        asks = status >= 500 or status == 429 or code in ("SlowDown", "RequestTimeout")
        return "answered" if asks and status != 501 else "final"
    no_answer = isinstance(error, (*S3_RETRYABLE_ERRORS, ConnectionError, botocore.exceptions.ConnectionError))
    return "unreached" if no_answer else "final"
