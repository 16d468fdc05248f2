"""Ends of the command line: every exception and signal becomes one sentence on stderr and an exit code.

0 success, 1 work that failed, 2 bad input, 130 Ctrl-C, 143 SIGTERM, 129 SIGHUP. An exception that nobody expected is a
bug: its traceback goes to a file, and the sentence names the file.
"""

import errno
import io
import os
import shlex
import signal
import sys
import tempfile
import threading
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import pairwise
from pathlib import Path
from typing import Final

from cyclopts import CycloptsError, MissingArgumentError

from weaves.errors import BadInput, WorkFailed, one_line

_RESUMED: Final = {"run", "generate", "train", "bench", "report", "publish"}  # verbs that go on after a stop


def run_to_exit(verb: Callable[[], object], tokens: Sequence[str], out: Path) -> int:
    """Call a verb and return its exit code, after printing the sentence of an error.

    An integer that the verb returns is the exit code. The report of a crash has its command line, and lies in the
    folder `out` if that names none.
    """
    if sys.stdout is None:  # it was closed before the start
        return _end("stdout is closed; send it to a file or to /dev/null", 2)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # names that are no UTF-8, terminals that show less
    stops: list[KeyboardInterrupt] = []

    def stop(number: int, frame: object) -> None:
        stops.append(KeyboardInterrupt() if number == signal.SIGINT else _Stopped(number))
        raise stops[-1]

    # Where Ctrl-C is ignored, as in the background of a shell, it stays so.
    interrupt = {signal.SIGINT} if signal.getsignal(signal.SIGINT) is signal.default_int_handler else set()
    try:
        with handled(stop, signal.SIGTERM, signal.SIGHUP, *interrupt):  # what must be closed is closed
            answer = verb()
        sys.stdout.flush()
        return answer if isinstance(answer, int) else 0
    except (Exception, KeyboardInterrupt) as error:
        return _handle(error, stops, tokens, out)


def _handle(raised: BaseException, stops: Sequence[BaseException], tokens: Sequence[str], out: Path) -> int:
    """Print the sentence of an exception, and return the exit code."""
    error = _wrapped(raised, stops)
    if isinstance(error, CycloptsError):
        return _end(_missing(error) or f"twillight: {error}", 2)
    if isinstance(error, BadInput | WorkFailed):
        return _end(str(error), error.exit_code)
    if isinstance(error, KeyboardInterrupt):
        sentence = str(error) or "stopped"
        if not _RESUMED.isdisjoint(tokens[:1]) and ";" not in sentence:
            sentence += "; finished work is kept, and the same command continues"
        return _end(sentence, error.code if isinstance(error, _Stopped) else 130)
    if isinstance(error, BrokenPipeError):  # the reader of the output has closed it, such as `head`
        _drop_stdout()
        return 0
    if isinstance(error, OSError) and error.filename is None and _stdout_fails():
        _drop_stdout()
        return _end(f"stdout: {error.strerror}; what was to be printed is lost", 1)
    if "upath" in sys.modules:  # object storage is in use
        from pipeline.storage import explained

        if told := explained(error):
            return _end(str(told), told.exit_code)
    if isinstance(error, OSError) and error.errno in (errno.ENAMETOOLONG, errno.ELOOP):  # no file can have this path
        return _end(f"{one_line(error.filename, 80, keep='end')}: {error.strerror}: another path is needed", 2)
    if type(error).__name__ == "ShellDetectionError":
        return _end("twillight --install-completion: the shell is not known: add --shell bash, zsh or fish", 2)
    saved = _save_crash(tokens, "".join(traceback.format_exception(raised)), out)
    return _end(f"{type(error).__name__}: this is a bug in twillight; {saved}", 1)


def _stdout_fails() -> bool:
    """Return whether stdout takes no more: the error of a write names no file."""
    try:
        print(flush=True)  # noqa: T201, an empty line
    except OSError:
        return True
    return False


def _drop_stdout() -> None:
    """Send what stdout still holds nowhere, so that Python ends without a word about it."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _missing(error: CycloptsError) -> str:
    """Return which argument is missing and what it is; empty for any other error."""
    if not isinstance(error, MissingArgumentError) or (argument := error.argument) is None or not error.command_chain:
        return ""
    verb, name = " ".join(error.command_chain), argument.name
    if argument.index is not None:
        name = name.removeprefix("--").upper()
    lacks = "lacks its value" if argument.tokens or error.keyword else "is missing"
    return f"{verb}: {name} {lacks}: {argument.parameter.help} See `twillight {verb} --help`"


def _wrapped(raised: BaseException, stops: Sequence[BaseException]) -> BaseException:
    """Return the sentence or the stop that a library reported as its own error; else the exception itself.

    Dr.Jit raises a RuntimeError from whatever ends a BSDF in Python; pydantic hides the cause, one of `stops`.
    """
    cause: BaseException | None = raised
    while cause is not None:
        if isinstance(cause, BadInput | WorkFailed | KeyboardInterrupt):
            return cause
        cause = cause.__cause__
    return stops[0] if stops else raised


class _Stopped(KeyboardInterrupt):
    """A signal that ends a process, handled as Ctrl-C is."""

    def __init__(self, number: int) -> None:
        super().__init__(f"stopped by {signal.Signals(number).name}")
        self.code = 128 + number


@contextmanager
def handled(handler: Callable[[int, object], None], *numbers: int) -> Iterator[None]:
    """Handle signals within a block, which is of the main thread: others receive none."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, handler) for number in numbers}
    try:
        yield
    finally:
        for number, own in before.items():
            signal.signal(number, own)


def _end(sentence: str, code: int) -> int:
    print_error(sentence)
    return code


def print_error(sentence: str) -> None:
    """Print the sentence of an error to stderr, in one line and with no character that a terminal obeys."""
    with suppress(OSError):  # a full or closed stderr leaves the exit code
        print(one_line(sentence), file=sys.stderr, flush=True)  # noqa: T201, rich would break the line


def _save_crash(tokens: Sequence[str], trace: str, out: Path) -> str:
    """Save a traceback in the output folder, if there is one, else in the system's temporary folder; say where.

    No folder is created: what follows `--out` may name a file that a verb was to write.
    """
    given = [token.removeprefix("--out=") for token in tokens if token.startswith("--out=")]
    given += [value for option, value in pairwise(tokens) if option == "--out"]
    named = Path(given[0]) if given and "://" not in given[0] else out
    for folder in (named, Path(tempfile.gettempdir())):
        try:
            handle, name = tempfile.mkstemp(".txt", "crash-", folder)
            with open(handle, "w", encoding="utf-8", errors="backslashreplace") as file:  # noqa: PTH123, a handle
                file.write(f"twillight {shlex.join(tokens)}\n\n{trace}")
        except OSError:
            continue
        return f"please report it with {name}"
    return "no report of it could be written"
