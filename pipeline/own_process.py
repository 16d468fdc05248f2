"""Work in a process of its own: of code that may hang or crash, of what measures time, and of what shares nothing.

The process is started as a command, because a worker of dask may not have children of `multiprocessing`. The command
itself only watches: the work is in a child of it. Whatever the work has started, in sessions of their own too, becomes
the watcher's when its parent is gone [prctl(2), PR_SET_CHILD_SUBREAPER]. It kills all of it when the work has ended, or
when the process that waits for the result is gone.
"""

from __future__ import annotations

import ctypes
import os
import pickle
import select
import signal
import subprocess
import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any, Final, NoReturn, TypeVar

from weaves.errors import WorkFailed

Result = TypeVar("Result")

ONE_THREAD: Final = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "MKL", "OPENBLAS", "NUMBA")}
"""Environment of a process that computes on one thread."""

_SECONDS_BETWEEN_LOOKS: Final = 0.2
_MOST_ROUNDS: Final = 1000
_PDEATHSIG, _CHILD_SUBREAPER = 1, 36  # of prctl(2)


class ProcessEnded(WorkFailed):
    """The process has ended without a result."""

    def __init__(self, code: int) -> None:
        self.code = code
        self.how = f"exit code {code}" if code >= 0 else f"signal {signal.Signals(-code).name}"
        super().__init__(f"the process that ran it ended ({self.how}); is there enough memory?")

    def __reduce__(self) -> tuple[type[ProcessEnded], tuple[int]]:
        return type(self), (self.code,)


def in_own_process(
    function: Callable[..., Result],
    *arguments: Any,
    progress: Callable[[float], None] = lambda share: None,
    look: Callable[[], None] = lambda: None,
) -> Result:
    """Call ``function(*arguments, progress)`` in a new process of one thread, and return its result.

    The process ends with this one, with all that it has started, and never receives Ctrl-C. What it prints is lost.
    The function is one of a module, or a method; it, its arguments and its result can be pickled. `progress` receives
    the finished share. `look` is called now and then while nothing is received; an exception of it ends the process.

    ProcessEnded if the process ends without a result. What the function raises has its traceback as a note.
    """
    (here, there), (watched, held) = Pipe(), os.pipe()  # the latter ends with this process
    # The paths of this process, and no other: a folder of the current one must not hide a package.
    paths = os.pathsep.join(path or os.getcwd() for path in sys.path)  # noqa: PTH109, a string is needed
    with interrupts_held():
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", "pipeline.own_process", str(there.fileno()), str(watched)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env={**os.environ, **ONE_THREAD, "PYTHONPATH": paths},
            pass_fds=[there.fileno(), watched],
            start_new_session=True,
        )
    there.close()
    os.close(watched)
    try:
        here.send((function, arguments))
        while True:
            if not here.poll(_SECONDS_BETWEEN_LOOKS):
                look()
                if process.poll() is not None and not here.poll():
                    raise ProcessEnded(process.returncode)
                continue
            kind, content = here.recv()
            if kind == "raised":
                raise content
            if kind == "result":
                result: Result = content
                return result
            progress(content)
    except (EOFError, ConnectionError) as error:
        raise ProcessEnded(process.wait()) from error
    finally:
        os.close(held)
        process.wait()
        here.close()


@contextmanager
def interrupts_held() -> Iterator[None]:
    """Hold Ctrl-C back within; threads and processes that start there never receive it, as only the driver should."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _main() -> NoReturn:
    """Do work in a child, and end as it ends; the numbers of the pipes of `in_own_process` are given."""
    sys.dont_write_bytecode = True  # nothing is written beside the code of others
    pipe, watched = Connection(int(sys.argv[1])), int(sys.argv[2])
    _prctl(_CHILD_SUBREAPER, 1)
    worker = os.fork()
    if worker == 0:
        _prctl(_PDEATHSIG, signal.SIGKILL)
        os.setsid()  # the watcher is in no group that the work may signal
        os.close(watched)
        _work(pipe)
    pipe.close()
    import psutil  # here: the work begins meanwhile

    ended, status = 0, 0
    while not ended and not select.select([watched], [], [], _SECONDS_BETWEEN_LOOKS)[0]:
        ended, status = os.waitpid(worker, os.WNOHANG)
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(worker, signal.SIGKILL)  # where no process adopts those of its children, its group is what is known
    for _ in range(_MOST_ROUNDS):  # what is killed may just have started another process, and is its parent's to bury
        for process in (left := psutil.Process().children(recursive=True)):
            with suppress(psutil.Error):
                process.kill()
        if not left:
            break
        with suppress(ChildProcessError):
            os.waitpid(-1, os.WNOHANG)
    if os.WIFSIGNALED(status):
        os.kill(os.getpid(), os.WTERMSIG(status))
    os._exit(os.waitstatus_to_exitcode(status))


def _work(pipe: Connection) -> NoReturn:
    """Do the work of the process at the other end of a pipe, and send the result."""
    try:
        function, arguments = pipe.recv()
        answer = "result", function(*arguments, lambda share: pipe.send(("share", float(share))))
    except BaseException as error:
        answer = "raised", _portable(error)
    pipe.send(answer)
    os._exit(0)  # threads that the work has left running do not hold the process


def _prctl(option: int, value: int) -> None:
    if sys.platform == "linux":  # alone has these properties of a process
        ctypes.CDLL(None).prctl(option, value, 0, 0, 0)


def _portable(error: BaseException) -> Exception:
    """Return an exception with its traceback as a note; one that cannot be sent, or would end the parent, by name."""
    trace = traceback.format_exc()
    try:
        portable = isinstance(pickle.loads(pickle.dumps(error)), Exception)
    except Exception:
        portable = False
    sent = error if portable and isinstance(error, Exception) else RuntimeError(repr(error))
    sent.add_note(trace)
    return sent


if __name__ == "__main__":
    _main()
