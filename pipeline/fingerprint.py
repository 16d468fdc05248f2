"""Identity of a specification: canonical bytes, and their SHA-256.

Two specifications are the same work exactly when their fingerprints agree. Stage VERSIONs are part of what is
fingerprinted; the git revision is not.
"""

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

IDENTITY: Final = "identity"
"""Context of a pydantic dump that leaves out what decides no result, such as where files lie."""


def canonical(specification: Any) -> bytes:
    """Return the canonical bytes of a JSON-able specification.

    Keys are sorted, floats use Python's shortest round-trip form, and an integral float equals the integer (TOML users
    write 1 and 1.0 alike). ValueError if a number is NaN or infinite.
    """
    return json.dumps(_plain(specification), sort_keys=True, separators=(",", ":"), allow_nan=False).encode()


def fingerprint(specification: Any, length: int = 16) -> str:
    """Return the first `length` hexadecimal digits of the SHA-256 of the canonical bytes."""
    return hashlib.sha256(canonical(specification)).hexdigest()[:length]


def fingerprints(kind: str, specification: Mapping[str, Any], changes: Iterable[Mapping[str, int]]) -> Iterator[str]:
    """Yield ``fingerprint([kind, specification | change])`` of each change; what does not change is encoded once."""
    parts = {key: canonical({key: value})[1:-1] for key, value in specification.items()}
    head = canonical([kind])[:-1]
    for change in changes:
        own = parts | {key: f'"{key}":{value}'.encode() for key, value in change.items()}
        yield hashlib.sha256(head + b",{" + b",".join(own[key] for key in sorted(own)) + b"}]").hexdigest()[:16]


def file_sha256(path: Path) -> str:
    """Return the SHA-256 of a file's bytes, in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and value.is_integer():
        return int(value)
    return value


def stream_seed(purpose: str, belongs_to: Sequence[Any]) -> int:
    """Return the seed of a stream, 0 <= seed < 2^64: the fingerprint of its JSON-able parts."""
    return int(fingerprint([purpose, *belongs_to], 16), 16)
