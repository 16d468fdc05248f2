"""Files of a page's folder with their hashes: ``files.json``, so that a damaged one is found."""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from pydantic import TypeAdapter, ValidationError

from pipeline.atomic import atomic_write
from pipeline.fingerprint import file_sha256
from weaves.errors import BadInput
from weaves.reading import MIB, read_bytes

FILES: Final = "files.json"  # it lists neither itself nor ``index.html``, which is written last


def write_files(folder: Path, names: Iterable[str]) -> None:
    """List files of a page, given by their paths in its folder, and remove those that only the list before had.

    One that was changed since it was listed stays.
    """
    hashes = {name: file_sha256(folder / name) for name in sorted(names)}
    try:
        earlier = read_files(folder)
    except BadInput:
        earlier = {}
    for name, sha256 in earlier.items():
        if name not in hashes and (folder / name).is_file() and file_sha256(folder / name) == sha256:
            (folder / name).unlink()
    atomic_write(folder / FILES, json.dumps(hashes, indent=1).encode() + b"\n")


def read_files(folder: Path) -> dict[str, str]:
    """Return the SHA-256 of each file of a page by its path in the folder; BadInput if there is no valid list."""
    path = folder / FILES
    try:
        content = read_bytes(path, 16 * MIB, "a list of files")
        hashes = TypeAdapter(dict[str, str]).validate_json(content, strict=True)
    except FileNotFoundError as error:
        raise BadInput(str(path), "", "does not exist", "write the page again with `twillight report`") from error
    except (OSError, ValidationError) as error:
        raise BadInput(str(path), "", "damaged", "write the page again with `twillight report`") from error
    if any(Path(name).is_absolute() or ".." in Path(name).parts for name in hashes):
        raise BadInput(str(path), "", "names files outside of its folder", "write the page again")
    return hashes
