"""Version of the numbers in a shard; apart from the kernels so that a plan needs no compiler."""

from typing import Final

VERSION: Final = 3
"""Raised by hand when any number of a shard changes (truth, sequences, queries); part of every shard's identity."""
