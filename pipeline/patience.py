"""Patience with a storage that fails for a while: requests are repeated, with growing pauses, for a stated time.

A storage that has answered before, or that answers with an error of its own, gets `MOST_SECONDS`; one that was never
reached gets `UNREACHED_SECONDS`, because its address may be wrong. The first failure is reported to a listener, at
most once in a minute.
"""

import asyncio
import sys
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Final, Literal, TypeVar

from weaves.errors import WorkFailed, one_line

MOST_SECONDS: Final = 600.0  # time for which a request is repeated

UNREACHED_SECONDS: Final = 4.0  # time for which a request is repeated if no request of this run was ever answered

_FIRST_PAUSE: Final = 0.5
_LONGEST_PAUSE: Final = 10.0  # seconds
_QUIET: Final = 60.0  # seconds without a failure, after which the next one is reported again

Failure = Literal["answered", "unreached", "final"]
"""Kind of an error: an answer after which to try again; no answer; or one that would come again."""

Answer = TypeVar("Answer")


class StorageFailed(WorkFailed):
    """A storage has failed for longer than it is waited for."""


@dataclass
class _State:
    reached: bool = False
    given_up: bool = False
    failed: float = -_QUIET  # time of the last failure
    listener: Callable[[str], None] | None = None


_state: Final = _State()


def tell(listener: Callable[[str], None] | None) -> None:
    """Set the listener for waits for a storage; None: it is printed on stderr. Calls come from another thread."""
    _state.listener = listener


def expect() -> None:
    """Note that another process of this run was answered."""
    _state.reached = True


def give_up() -> None:
    """Note that another process of this run has waited long enough: requests of this one are not repeated."""
    _state.given_up = True


async def patiently(request: Callable[[], Awaitable[Answer]], kind_of: Callable[[Exception], Failure]) -> Answer:
    """Return the answer to a request; repeat it while it fails by an error that may pass.

    StorageFailed if it fails for too long; an error that would come again is raised as it is.
    """
    begun, pause = time.monotonic(), _FIRST_PAUSE
    while True:
        try:
            answer = await request()
        except Exception as error:
            kind = kind_of(error)
            _state.reached |= kind != "unreached"
            if kind == "final":
                raise
            most = 0.0 if _state.given_up else MOST_SECONDS if _state.reached else UNREACHED_SECONDS
            if time.monotonic() - begun >= most:
                _state.given_up = True
                raise _failed(error, most) from error
            if _state.reached:
                _tell(error)
        else:
            _state.reached, _state.given_up = True, False
            return answer
        await asyncio.sleep(pause)
        pause = min(2 * pause, _LONGEST_PAUSE)


def _failed(error: Exception, seconds: float) -> StorageFailed:
    reason = one_line(error, 120)
    if not _state.reached:
        return StorageFailed(f"the object storage cannot be reached ({reason})")
    how = f"has failed for {_minutes(seconds)}" if seconds else "still fails"
    return StorageFailed(f"the object storage {how} ({reason}); finished work is kept, and the same command continues")


def _tell(error: Exception) -> None:
    now = time.monotonic()
    new, _state.failed = now - _state.failed >= _QUIET, now
    if not new:
        return
    sentence = f"the object storage fails ({one_line(error, 120)}); waiting for it, {_minutes(MOST_SECONDS)} at most"
    if _state.listener is None:
        print(sentence, file=sys.stderr, flush=True)  # noqa: T201, verbs without a progress
    else:
        _state.listener(sentence)


def _minutes(seconds: float) -> str:
    return f"{seconds / 60:.0f} minutes" if seconds >= 120 else f"{seconds:.0f} s"
