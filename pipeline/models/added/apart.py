"""Work with a method from outside in a process of its own, which ends if a call hangs or the code crashes."""

import mmap
import resource
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TypeVar

from pipeline.models.added.added_code import CallLimits
from pipeline.models.added.guarded import GIB, STATE_BYTES, WATCH, Call, MethodFailed
from pipeline.own_process import ProcessEnded, in_own_process

Result = TypeVar("Result")


def run_apart(
    function: Callable[..., Result],
    *arguments: Any,
    limits: Iterable[CallLimits] = (CallLimits(),),
    progress: Callable[[float], None] = lambda share: None,
) -> Result:
    """Call ``function(*arguments, progress)`` in a process of its own, as `in_own_process` does.

    It has the most memory that any of the `limits` allows, and so has each process that it starts. It raises what the
    function raises; MethodFailed if a method from outside raises, returns nothing usable, takes too long in one call,
    or ends the process; WorkFailed if the process ends for another reason.
    """
    with tempfile.NamedTemporaryFile(prefix="twillight-") as state:
        state.truncate(STATE_BYTES)
        with mmap.mmap(state.fileno(), STATE_BYTES) as shared:

            def look() -> None:
                call = Call.read(shared)
                if call.late:
                    raise MethodFailed(call.name, f"{call.function} took longer than {call.limit:g} s, its limit")

            try:
                memory = int(max(each.memory for each in limits) * GIB)
                work = state.name, memory, function, arguments
                result: Result = in_own_process(_watched, *work, progress=progress, look=look)
                return result
            except ProcessEnded as error:
                call = Call.read(shared)
                if call.running > 0:
                    raise MethodFailed(call.name, f"{call.function} ended its process ({error.how})") from None
                raise


def _watched(
    state: str,
    memory: int,
    function: Callable[..., Result],
    arguments: tuple[Any, ...],
    progress: Callable[[float], None],
) -> Result:
    """Call a function with so many bytes of memory; calls of methods from outside are marked in the bytes of a file."""
    hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
    most = memory if hard == resource.RLIM_INFINITY else min(memory, hard)  # a limit of the account is never raised
    resource.setrlimit(resource.RLIMIT_DATA, (most, most))
    with Path(state).open("rb+") as file:
        WATCH.shared = mmap.mmap(file.fileno(), STATE_BYTES)
    return function(*arguments, progress)
