"""Receipt of a done task: its products with sizes and hashes. A file that is no valid receipt counts as missing."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Final

from pydantic import Field, ValidationError

from jobs.plan.task import Task
from pipeline.fingerprint import file_sha256
from weaves.errors import BadInput
from weaves.reading import MIB, read_bytes
from weaves.validation import Frozen

_END: Final = b"\n}\n"  # of the file
_LONGEST_LEAF: Final = 24  # characters of a value that is written as it is
_HASH: Final = re.compile(r"^#|\b[0-9a-f]{16}\b")

Leaf = str | int | float | bool | None
"""A value of an identity; a string that begins with # is the hash of a longer one."""


class Product(Frozen, strict=True):
    """A finished file: its hash and its size in bytes."""

    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
    bytes: Annotated[int, Field(ge=0)]

    @classmethod
    def of(cls, path: Path) -> Product:
        """Measure a finished file."""
        return cls(sha256=file_sha256(path), bytes=path.stat().st_size)


class Receipt(Frozen, strict=True):
    """Entry of the ledger for a done task."""

    task: str  # id of the task
    stage: str
    title: str
    files: dict[Annotated[str, Field(pattern=r"^[^/\\.][^/\\]*$")], Product]
    """Products by file name, which is never a path: a folder of products may come from a stranger."""
    seconds: Annotated[float, Field(ge=0.0)]
    identity: dict[str, Leaf] = Field(default_factory=dict)
    """Identity of the task by dotted keys of at most two parts, long values by their hash; for `changes`."""
    checksum: str = ""
    """Hash of the rest; receipts of earlier versions have none, and their bytes may be of another form."""

    @classmethod
    def of(cls, task: Task, files: Mapping[str, Product], seconds: float) -> Receipt:
        """Return the receipt of a task, without its checksum."""
        identity = _leaves(task.identity())
        heading = {"task": task.id, "stage": task.stage, "title": task.title}
        return cls(**heading, files=dict(files), seconds=round(seconds, 3), identity=identity)

    @classmethod
    def read(cls, path: Path, task: str) -> Receipt | None:
        """Return the receipt of the task with this id; None if the file is missing, damaged or of another task."""
        try:
            content = read_bytes(path, MIB, "a receipt")
            receipt = cls.model_validate_json(content)
        except (OSError, BadInput, ValidationError, RecursionError):
            return None
        return receipt if receipt.task == task and receipt._is_content_of(content) else None

    def encoded(self) -> bytes:
        """Return the bytes of its file."""
        return self.model_dump_json(indent=1, exclude_unset=True).encode() + b"\n"

    def sealed(self) -> bytes:
        """Return the bytes of the file of a receipt that has no checksum yet, with their checksum."""
        content = self.encoded()
        return content.removesuffix(_END) + _last_line(_checksum(content))

    def _is_content_of(self, file: bytes) -> bool:
        """Return whether a file's bytes are those that were written, as far as it has a checksum."""
        if "checksum" not in self.model_fields_set:
            return True
        rest = file.removesuffix(_last_line(self.checksum)) + _END
        return len(rest) < len(file) and self.checksum == _checksum(rest)

    def changes(self, now: Receipt) -> list[str]:
        """Return what differs in the identity of a later receipt: versions first, values where they are short."""
        changes = []
        for key in sorted(self.identity.keys() | now.identity.keys(), key=lambda key: ("version" not in key, key)):
            old, new = (receipt.identity.get(key, "–") for receipt in (self, now))
            if old != new:
                hashed = any(_HASH.search(str(value)) for value in (old, new))
                changes.append(key if hashed else f"{key} {old} → {new}")
        return changes


def _checksum(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]


def _last_line(checksum: str) -> bytes:
    return f',\n "checksum": "{checksum}"'.encode() + _END


def _leaves(identity: Mapping[str, Any]) -> dict[str, Leaf]:
    leaves: dict[str, Leaf] = {}
    for key, value in identity.items():
        parts = {f"{key}.{name}": part for name, part in value.items()} if isinstance(value, dict) else {}
        leaves |= {name: _leaf(part) for name, part in (parts or {key: value}).items()}
    return leaves


def _leaf(value: Any) -> Leaf:
    if value is None or isinstance(value, int | float) or (isinstance(value, str) and len(value) <= _LONGEST_LEAF):
        return value
    return f"#{hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()[:8]}"
