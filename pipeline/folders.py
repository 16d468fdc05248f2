"""Folders that a command writes again and again: its own files are replaced, everything else in them stays.

One JSON file of the folder, its listing, names every file of the command with its SHA-256 under `files`. What is listed
and unchanged may be replaced or removed. A listed file that was changed since, the listing itself too, and a foreign
one in the way of a new one are refused by name before anything is touched.

New files are made in ``.tmp-LISTING`` in the folder and then renamed into place, the listing last. Before the first
rename a journal beside them names old and new ones, so that a run after a kill knows which files are its own.
"""

import hashlib
import json
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path, PurePosixPath
from typing import Any, Final

from filelock import FileLock, Timeout

from pipeline.atomic import atomic_write, disk_errors
from pipeline.fingerprint import file_sha256
from weaves.errors import BadInput, WorkFailed

_FILES: Final = "files"  # key of a listing that has the SHA-256 of each file, by its path in the folder

Hashes = dict[str, set[str]]  # SHA-256 of every state of a file that the command wrote, by its path in the folder


@contextmanager
def own_files(folder: Path, listing: str) -> Iterator[Path]:
    """Yield an empty folder; on leaving without error its files take the place of those of an earlier run in `folder`.

    The folder is made if need be; files of others stay in it. A JSON object that is called as the listing among the new
    files is completed, else it is made.

    BadInput if a file of an earlier run was changed, a foreign one is in the way, or the folder cannot be written;
    WorkFailed if the disk is full, or another process writes the same files.
    """
    with disk_errors(folder):
        if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
            raise BadInput(str(folder), "", "is no folder", "name another place")
        existed, staging = folder.exists(), folder / f".tmp-{listing}"
        own = _own(folder, listing)
        _refuse_changed(folder, listing, own)
        if staging.is_symlink():
            raise _refusal(staging, "is in the way", "it is a link")
        staging.mkdir(parents=True, exist_ok=True)
        lock, journal, new = FileLock(staging / "lock"), staging / "journal.json", staging / "new"
        try:
            lock.acquire(timeout=0)
        except Timeout as error:
            raise WorkFailed(f"{folder}: another process writes {listing} and its files") from error
        try:
            shutil.rmtree(new, ignore_errors=True)
            new.mkdir()
            yield new
            _refuse_changed(folder, listing, own)
            _move(new, folder, listing, own)
            journal.unlink()
        finally:
            lock.release()
            if not journal.exists():
                shutil.rmtree(staging, ignore_errors=True)
            if not existed:
                with suppress(OSError):
                    folder.rmdir()


def _move(new: Path, folder: Path, listing: str, own: Hashes) -> None:
    """Move all files to the folder and remove those of before, if nothing is in the way."""
    names = sorted(path.relative_to(new).as_posix() for path in new.rglob("*") if path.is_file())
    hashes = {name: file_sha256(new / name) for name in names if name != listing}
    for name in (*hashes, listing):
        place = folder / name
        for above in [folder / part for part in PurePosixPath(name).parents][:-1]:
            if above.is_symlink() or (above.exists() and not above.is_dir()):
                raise _refusal(above, "is in the way", f"{name} belongs there")
        if (place.exists() or place.is_symlink()) and name not in own:
            raise _refusal(place, "is in the way", f"{listing} does not name it")
    about = json.loads((new / listing).read_text(encoding="utf-8")) if (new / listing).is_file() else {}
    about[_FILES] = {**hashes, listing: _content_sha256(about)}
    (new / listing).write_text(json.dumps(about, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    known = {name: sorted(own.get(name, set()) | {about[_FILES][name]}) for name in about[_FILES]}
    left = {name: sorted(values) for name, values in own.items() if name not in known}
    atomic_write(new.parent / "journal.json", json.dumps({**known, **left}).encode())
    for name in hashes:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (new / name).replace(folder / name)
    for name in left:
        (folder / name).unlink(missing_ok=True)
        for above in [folder / part for part in PurePosixPath(name).parents][:-1]:
            with suppress(OSError):  # it is not empty
                above.rmdir()
    (new / listing).replace(folder / listing)


def _refuse_changed(folder: Path, listing: str, own: Hashes) -> None:
    for name, hashes in own.items():
        path = folder / name
        if path.is_symlink() or path.is_dir():
            raise _refusal(path, "is no longer a file", f"{listing} names it")
        if not path.exists():
            continue
        sha256 = _content_sha256(_json(path)) if name == listing else file_sha256(path)
        if sha256 not in hashes:
            raise _refusal(path, "was changed", f"{listing} names it as it was written")


def _own(folder: Path, listing: str) -> Hashes:
    """Return the files of earlier runs, those of a run that was killed among them."""
    own: Hashes = {}
    path = folder / listing
    if path.exists() or path.is_symlink():
        own = {name: {sha256} for name, sha256 in _hashes(path, _json(path).get(_FILES)).items()}
    journal = folder / f".tmp-{listing}" / "journal.json"
    if journal.exists():
        for name, hashes in _hashes(journal, _json(journal)).items():
            own[name] = own.get(name, set()) | set(hashes)
    if own and listing not in own:
        raise _refusal(path, "is in the way", "it is no listing of this command")
    return own


def _hashes(path: Path, listed: Any) -> Mapping[str, Any]:
    """Return the hashes of a listing or a journal; refuse one that names files outside the folder, or none."""
    if not isinstance(listed, dict) or not listed:
        raise _refusal(path, "is in the way", "it lists no files of this command")
    for name in listed:
        if PurePosixPath(name).is_absolute() or ".." in PurePosixPath(name).parts or "\\" in name:
            raise _refusal(path, f"lists {name}", "only files in its folder can be listed")
    return listed


def _json(path: Path) -> dict[str, Any]:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise _refusal(path, "is in the way", "it lists no files of this command") from error
    return content if isinstance(content, dict) else {}


def _content_sha256(listing: Mapping[str, Any]) -> str:
    """Return the SHA-256 of a listing's own content, without its hashes."""
    content = {key: value for key, value in listing.items() if key != _FILES}
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _refusal(path: Path, state: str, reason: str) -> BadInput:
    return BadInput(str(path), "", state, f"{reason}; move it, or name another folder")
