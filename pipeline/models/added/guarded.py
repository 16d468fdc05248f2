"""A method from outside behind a guard: every fault of its code becomes a sentence.

`Guarded` checks what each call returns. It marks each call in a few shared bytes, so that the parent process can end
a call that takes too long (`pipeline.models.added.apart`).
"""

from __future__ import annotations

import math
import resource
import struct
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from pipeline.models.added.added_code import AddedFunction, AddedMethod
from pipeline.models.added.source import locate
from pipeline.models.method import refuse_other
from weaves.errors import BadInput, WorkFailed, brief, one_line

if TYPE_CHECKING:
    from pipeline.compiled.arrays import Float32
    from pipeline.models.domain import Domain
    from pipeline.models.method import Method
    from pipeline.truth.query import Queries
    from weaves.fabric import Fabric

_STATE: Final = struct.Struct("<ddi64s16s")
GIB: Final = 2**30  # bytes
_NO_MEMORY: Final = "can't allocate memory"  # in a RuntimeError of PyTorch
STATE_BYTES: Final = _STATE.size  # size of the shared bytes


class MethodFailed(WorkFailed):
    """A fault in the code of the method `name` from outside."""

    def __init__(self, name: str, reason: str) -> None:
        self.name, self.reason = name, reason
        super().__init__(one_line(f"{name}: {reason}"))

    def __reduce__(self) -> tuple[type[MethodFailed], tuple[str, str]]:
        return type(self), (self.name, self.reason)


class Call(NamedTuple):
    """Calls of a method that are under way."""

    since: float  # time of the last call's begin or end, by the monotonic clock
    limit: float  # seconds that a call may take
    running: int  # number of calls, one a thread at most
    name: str
    function: str
    """The method, and its function."""

    @classmethod
    def read(cls, shared: Any) -> Call:
        """Read the shared bytes."""
        since, limit, running, name, function = _STATE.unpack_from(shared)
        return cls(since, limit, running, *(text.rstrip(b"\0").decode(errors="replace") for text in (name, function)))

    @property
    def late(self) -> bool:
        """True if a call takes longer than it may."""
        return self.running > 0 and time.monotonic() - self.since > self.limit


class Watch:
    """Writes the calls that are under way into shared bytes, if there are any."""

    def __init__(self) -> None:
        self.shared: Any = None
        self._running, self._lock = 0, threading.Lock()

    def mark(self, change: int, name: bytes, function: bytes, limit: float) -> None:
        """Note the begin of a call (`change` = 1) or its end (-1)."""
        if self.shared is not None:
            with self._lock:
                self._running += change
                _STATE.pack_into(self.shared, 0, time.monotonic(), limit, self._running, name, function)


WATCH: Final = Watch()  # the calls of this process


@contextmanager
def faults_of(name: str, function: str, limit: float, root: Path) -> Iterator[None]:
    """Turn any exception in the block into a `MethodFailed`, and mark the block as a call.

    The call is of a `function` of the method `name`, may take `limit` seconds, and its code is the file `root`, or the
    package in this folder.
    """
    call = name.encode()[:64], function.encode()[:16], limit
    WATCH.mark(1, *call)
    try:
        yield
    except MethodFailed:
        raise
    except BaseException as error:  # SystemExit too: the method must not end the work of others
        failed = MethodFailed(name, f"{function}: {described(error, root)}")
        # A RuntimeError caused by a StopIteration is the latter to contextlib, which would raise it again.
        raise failed from (None if isinstance(error, StopIteration) else error)
    finally:
        WATCH.mark(-1, *call)


def described(error: BaseException, root: Path) -> str:
    """Return an exception in one line, with the line of the method's own code that raised it."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [f for f in frames if Path(f.filename) == root or root in Path(f.filename).parents]
    where = f" ({Path(own[-1].filename).name}, line {own[-1].lineno})" if own else ""
    limit = resource.getrlimit(resource.RLIMIT_DATA)[0]
    if limit != resource.RLIM_INFINITY and (isinstance(error, MemoryError) or _NO_MEMORY in str(error)):
        return f"it needs more than {limit / GIB:g} GiB of memory, its limit{where}"
    if isinstance(error, SyntaxError):
        where = f" ({Path(error.filename or root).name}, line {error.lineno})"
        return one_line(f"SyntaxError: {error.msg}{where}", 200)
    if isinstance(error, WorkFailed):
        return one_line(f"{error}{where}", 200)
    return one_line(f"{type(error).__name__}: {error}" if str(error) else type(error).__name__, 160) + where


class Guarded:
    """A method from outside with the interface of `pipeline.models.method.Method`.

    Its name in tables is that of its options; `root` is its file, or the folder of its package. Answers that are
    negative or not finite are refused if `values`; else only their form is checked. Without the `domain` of its
    training it takes any query. If methods know one fabric each, `of` returns that of a fabric, None if there is none.
    """

    def __init__(
        self,
        method: Method,
        options: AddedMethod,
        root: Path,
        values: bool = True,
        domain: Domain | None = None,
        of: Callable[[Fabric], Any] | None = None,
    ) -> None:
        self.name, self.setting = options.name, options.setting
        self.method, self.options, self.root, self._values = method, options, root, values
        self.domain, self.of, self._first = domain, of or (lambda fabric: method), True

    def covers(self, fabric: Fabric) -> bool:
        """Return whether the method covers a fabric."""
        with self._call("covers"):
            own = self.of(fabric)
            return own is not None and bool(own.covers(fabric))

    def prepare(self, fabric: Fabric) -> None:
        """Prepare a fabric."""
        with self._call("prepare"):
            self.of(fabric).prepare(fabric)

    def predict(self, fabric: Fabric, queries: Queries, seed: int = 0) -> Float32:
        """Return the components of N queries, float32 (N, 4), finite and >= 0; BadInput for kinds it does not state."""
        refuse_other(queries, f"the method {self.name} answers", self.options.kinds)
        before = [column.copy() for column in queries] if self._first else None
        with self._call("predict"):
            answers: Float32 = self.of(fabric).predict(fabric, queries, seed)
        if fault := self._fault(answers, len(queries.u)):
            raise MethodFailed(self.name, f"predict returned {fault}, for the fabric {fabric.name}")
        if before is not None:
            self._first = False
            if not all(np.array_equal(old, new) for old, new in zip(before, queries, strict=True)):
                raise MethodFailed(self.name, "predict changed the arrays of its queries; it must copy them first")
        return answers

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the bytes that a renderer stores for a fabric; MethodFailed unless it is an integer >= 0."""
        with self._call("bytes_stored"):
            found: object = self.of(fabric).bytes_stored(fabric)
        if isinstance(found, bool) or not isinstance(found, int | np.integer) or not 0 <= found < 2**63:
            allowed = "an integer from 0 to 2^63 - 1 is needed"
            raise MethodFailed(self.name, f"bytes_stored returned {brief(found)}; {allowed}")
        return int(found)

    def _call(self, function: str) -> Any:
        return faults_of(self.name, function, self.options.limit, self.root)

    def _fault(self, answers: object, rows: int) -> str:
        """Return what is wrong with answers; empty if nothing is."""
        if not isinstance(answers, np.ndarray):
            return f"{type(answers).__name__}; a NumPy array is needed"
        if answers.shape != (rows, 4) or answers.dtype != np.float32:
            return f"{answers.dtype} {answers.shape}; float32 ({rows}, 4) is needed"
        # The least is NaN if any is. Both passes take half a nanosecond a query; the guard takes 7 microseconds a call.
        if not self._values or not rows or (answers.min() >= 0.0 and answers.max() < np.inf):
            return ""
        for wrong, name in ((~np.isfinite(answers), "not finite"), (answers < 0.0, "negative")):
            if (found := np.flatnonzero(wrong.any(axis=1))).size:
                row = int(found[0])
                return f"{found.size} of {rows} rows with values that are {name} (first row {row}: {answers[row]})"
        return ""


def unchecked(method: Method) -> Method:
    """Return a method whose answers may have any value: one from outside without that check, others as they are."""
    if not isinstance(method, Guarded):
        return method
    return Guarded(method.method, method.options, method.root, False, method.domain, method.of)


def load_function(options: AddedFunction) -> Callable[..., float]:
    """Import a metric, and let it raise MethodFailed unless it returns a finite number; errors as `imported`."""
    function, root = imported(options)

    def measured(*arguments: Any) -> float:
        with faults_of(options.name, "the metric", options.limit, root):
            value = function(*arguments)
            number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
            finite = number and math.isfinite(value)
        if not finite:
            raise MethodFailed(options.name, f"it returned {brief(value)}; a finite number is needed")
        return float(value)

    return measured


def load_added(options: AddedMethod) -> Guarded:
    """Import and make a method from outside that is not trained; errors as `imported`, MethodFailed if making fails."""
    make, root = imported(options)
    return Guarded(new(make, options, root), options, root)


def new(make: Callable[..., Method], options: AddedMethod, root: Path) -> Method:
    """Make a method with its own options; MethodFailed if that fails."""
    with faults_of(options.name, "__init__", options.limit, root):
        return make(**options.own)


def imported(options: AddedMethod | AddedFunction) -> tuple[Any, Path]:
    """Import code from outside; return the class or function, and its file or the folder of its package.

    MethodFailed if the code is gone, is not the planned one, or cannot be imported.
    """
    try:
        source = locate(options.source, options.folder)
        source.verify(options.sha256)
    except (BadInput, WorkFailed, OSError) as error:
        raise MethodFailed(options.name, str(error)) from error
    with faults_of(options.name, "import", options.limit, source.root):
        module = source.imported()
    return source.of(module), source.root
