"""Files that exist whole or not at all: written under a temporary name, synced, renamed into place."""

import errno
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from pipeline import storage
from weaves.errors import BadInput, WorkFailed

_UNWRITABLE = {errno.ENOENT, errno.EACCES, errno.EPERM, errno.EROFS, errno.ENOTDIR, errno.EEXIST, errno.EISDIR}
_UNWRITABLE |= {errno.ENAMETOOLONG, errno.ELOOP}


@contextmanager
def atomic_path(path: Path, *, durable: bool = True) -> Iterator[Path]:
    """Yield a temporary path beside `path`; on leaving without error it is synced and renamed to `path`.

    A process killed in between leaves only a ``.tmp-*`` file, which no reader looks at and the next writer replaces.
    For object storage the temporary file is one of this machine.

    Not `durable`, it saves the two waits for the disk: the file is whole or missing after a kill, and may be empty
    after a loss of power. BadInput if the folder cannot be created or written, WorkFailed if the disk is full.
    """
    if not storage.is_local(path):
        with tempfile.TemporaryDirectory(prefix="twillight-") as folder:
            yield (copy := Path(folder) / path.name)
            storage.store(copy, path)
        return
    if path.is_dir():
        raise BadInput(str(path), "", "is a folder", "the path of a file is needed")
    temporary = path.with_name(f".tmp-{path.name}")
    try:
        with disk_errors(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            yield temporary
            if durable:
                with temporary.open("rb+") as file:
                    os.fsync(file.fileno())
            temporary.replace(path)
            if durable:
                _sync_folder(path.parent)
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def atomic_write(path: Path, content: bytes, *, durable: bool = True) -> None:
    """Write `content` to `path` whole or not at all; `durable` as for `atomic_path`."""
    with atomic_path(path, durable=durable) as temporary:
        temporary.write_bytes(content)


@contextmanager
def disk_errors(path: Path) -> Iterator[None]:
    """Turn errors of the disk inside into BadInput, if the place cannot be written, or WorkFailed."""
    try:
        yield
    except OSError as error:
        if error.errno in _UNWRITABLE:
            raise _unwritable(path, error) from error
        raise WorkFailed(f"{path}: {error.strerror or error}; what was written before is kept") from error


def refuse_unwritable(path: Path) -> None:
    """Create the folder of a file that long work is to write; BadInput if it cannot be written."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path.parent):
            pass
    except OSError as error:
        raise _unwritable(path, error) from error
    if path.is_dir():
        raise BadInput(str(path), "", "is a folder", "the path of a file is needed")


def _unwritable(path: Path, error: OSError) -> BadInput:
    return BadInput(str(path.parent), "", error.strerror or "not writable", "a folder that can be written is needed")


def _sync_folder(folder: Path) -> None:
    """Make the rename itself durable."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def link(source: Path, target: Path) -> None:
    """Let a second path, whole or not at all, name the same bytes; a copy of them where there are no links."""
    if not storage.is_local(target):
        storage.copy(source, target)
        return
    with atomic_path(target) as temporary:
        temporary.unlink(missing_ok=True)
        try:
            os.link(source, temporary)
        except OSError:  # another file system, or one without links
            shutil.copyfile(source, temporary)
