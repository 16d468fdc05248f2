"""Names of streams of random numbers: a purpose and all that the stream belongs to, as a 64-bit seed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pipeline.fingerprint import fingerprint


def stream_seed(purpose: str, belongs_to: Sequence[Any]) -> int:
    """Return the seed of a stream, 0 <= seed < 2^64: the fingerprint of its JSON-able parts."""
    return int(fingerprint([purpose, *belongs_to], 16), 16)
