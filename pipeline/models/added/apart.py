"""Work with a method from outside in a process of its own, which ends if a call hangs or the code crashes."""

from __future__ import annotations

import mmap
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any, Final, TypeVar

from pipeline.models.added.guarded import STATE_BYTES, Call, MethodFailed
from weaves.errors import WorkFailed

Result = TypeVar("Result")

_SECONDS_BETWEEN_LOOKS: Final = 0.2


def run_apart(
    function: Callable[..., Result], *arguments: Any, progress: Callable[[float], None] = lambda share: None
) -> Result:
    """Call ``function(*arguments, progress)`` in a new process and return its result.

    Parameters
    ----------
    function : callable
        A function of a module; it, its arguments and its result can be pickled.
    arguments
        Its arguments.
    progress : callable
        Receives the finished share.

    Raises
    ------
    MethodFailed
        If a method from outside raises, returns nothing usable, takes too long in one call, or ends the process.
    BadInput, WorkFailed
        As the function does; WorkFailed also if the process ends for another reason.
    """
    with tempfile.TemporaryFile() as state:
        state.truncate(STATE_BYTES)
        shared = mmap.mmap(state.fileno(), STATE_BYTES)
        here, there = Pipe()
        numbers = there.fileno(), state.fileno()
        # The paths of this process, and no other: a folder of the current one must not hide a package.
        paths = os.pathsep.join(path or os.getcwd() for path in sys.path)  # noqa: PTH109, a string is needed
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", "pipeline.models.added.child", *map(str, numbers)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env={**os.environ, "PYTHONPATH": paths},
            pass_fds=numbers,
        )
        there.close()
        try:
            here.send((function, arguments))
            result: Result = _received(process, here, shared, progress)
            return result
        except (BrokenPipeError, ConnectionResetError) as error:
            raise WorkFailed("the process for methods from outside could not start") from error
        finally:
            process.kill()
            process.wait()
            here.close()
            shared.close()


def _received(
    process: subprocess.Popen[bytes], pipe: Connection, shared: Any, progress: Callable[[float], None]
) -> Any:
    """Show progress until the result arrives."""
    while True:
        if not pipe.poll(_SECONDS_BETWEEN_LOOKS):
            call = Call.read(shared)
            if call.late:
                raise MethodFailed(call.name, f"{call.function} took longer than {call.limit:g} s, its limit")
            continue
        try:
            kind, content = pipe.recv()
        except (EOFError, OSError):
            raise _death(process.wait(), Call.read(shared)) from None
        match kind:
            case "share":
                progress(content)
            case "result":
                return content
            case "raised":
                raise content
            case _:
                raise RuntimeError(content)


def _death(code: int, call: Call) -> WorkFailed:
    """Return the error of a process that ended without a result."""
    how = f"exit code {code}" if code >= 0 else f"signal {signal.Signals(-code).name}"
    if call.running > 0:
        return MethodFailed(call.name, f"{call.function} ended its process ({how})")
    return WorkFailed(f"the process that ran it ended ({how}); is there enough memory?")
