"""Work with a method from outside in a process of its own, which ends if a call hangs or the code crashes."""

from __future__ import annotations

import mmap
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from pipeline.models.added.guarded import STATE_BYTES, WATCH, Call, MethodFailed
from pipeline.own_process import ProcessEnded, in_own_process

Result = TypeVar("Result")


def run_apart(
    function: Callable[..., Result], *arguments: Any, progress: Callable[[float], None] = lambda share: None
) -> Result:
    """Call ``function(*arguments, progress)`` in a process of its own, as `in_own_process` does.

    It raises what the function raises; MethodFailed if a method from outside raises, returns nothing usable, takes too
    long in one call, or ends the process; WorkFailed if the process ends for another reason.
    """
    with tempfile.NamedTemporaryFile(prefix="twillight-") as state:
        state.truncate(STATE_BYTES)
        with mmap.mmap(state.fileno(), STATE_BYTES) as shared:

            def look() -> None:
                call = Call.read(shared)
                if call.late:
                    raise MethodFailed(call.name, f"{call.function} took longer than {call.limit:g} s, its limit")

            try:
                result: Result = in_own_process(_watched, state.name, function, arguments, progress=progress, look=look)
                return result
            except ProcessEnded as error:
                call = Call.read(shared)
                if call.running > 0:
                    raise MethodFailed(call.name, f"{call.function} ended its process ({error.how})") from None
                raise


def _watched(
    state: str, function: Callable[..., Result], arguments: tuple[Any, ...], progress: Callable[[float], None]
) -> Result:
    """Call a function, with the calls of methods from outside marked in the bytes of a file."""
    with Path(state).open("rb+") as file:
        WATCH.attach(mmap.mmap(file.fileno(), STATE_BYTES))
    return function(*arguments, progress)
