"""How kernels are compiled: single-threaded, without the GIL, cached on disk, the same bits whoever compiled them.

numba notices a changed file but not a changed file that it calls into. So a kernel's cache folder is named after the
content of its module and of all modules of `pipeline` and `reports` that this one imports, directly or not. The name
depends on no path: copies of the tree share one cache (`NUMBA_CACHE_DIR`). A process that began before one of these
files was changed shares nothing: it may have imported the file as it was. No fast-math but where a kernel says so
(`fast_kernel`).

pipeline.compiled.reproducible sees to it that neither the process nor the order of first use changes a bit. Processes
compile different kernels at the same time. Of one kernel, one process alone: the others wait and read what it wrote,
because numba lets two processes overwrite each other's index of a kernel. A kernel is compiled while the locks of its
callers are held; calls form no circle, so no two processes wait for each other.

What other kernels call is compiled for them alone, without machine code; if Python calls it too, once more.
"""

from __future__ import annotations

import gc
import hashlib
import os
import re
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar, cast

import numba
from filelock import FileLock
from numba.core.caching import CompileResultCacheImpl, FunctionCache, UserProvidedCacheLocator
from numba.core.compiler_lock import global_compiler_lock

from pipeline.compiled.reproducible import make_reproducible

_Function = TypeVar("_Function", bound=Callable[..., Any])

_HOME = Path(__file__).parent
_ROOT = _HOME.parents[1]
_BEGAN = time.time()  # of this process, before it imports any module with kernels
_IMPORT = re.compile(r"^[ \t]*from[ \t]+((?:pipeline|reports)[\w.]*)[ \t]+import[ \t]+(\([^)]*\)|.+)", re.MULTILINE)


def _cache_home() -> Path:
    """Return where compiled kernels are kept: ``NUMBA_CACHE_DIR``, this package's ``__pycache__``, the user's cache."""
    if chosen := numba.config.CACHE_DIR:  # type: ignore[attr-defined]
        return Path(chosen)
    if os.access(_HOME, os.W_OK):
        return _HOME / "__pycache__"
    return Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "twillight"


@cache
def _imported(path: Path) -> frozenset[Path]:
    """Return the files of `pipeline` and `reports` that a file imports."""
    files = set()
    for package, names in _IMPORT.findall(path.read_text(encoding="utf-8")):
        for module in (package, *(f"{package}.{name}" for name in re.findall(r"\w+", names))):
            place = _ROOT.joinpath(*module.split("."))
            files |= {file for file in (place.with_suffix(".py"), place / "__init__.py") if file.is_file()}
    return frozenset(files)


@cache
def _cache_folder(module: str, path: Path) -> Path:
    """Return the folder for a module's compiled kernels, named after its sources and those that it imports."""
    sources, left = set(), {path}
    while left:
        sources |= left
        left = {file for source in left for file in _imported(source)} - sources
    content = hashlib.sha256(path.read_bytes())
    for source in sorted(sources - {path}):
        content.update(source.read_bytes())
    now = time.time()  # clocks that are off date files in the future
    changed = any(_BEGAN < source.stat().st_mtime <= now for source in sources)
    return (Path(_own_cache().name) if changed else _CACHE) / f"{module}-{content.hexdigest()[:12]}"


@cache
def _own_cache() -> TemporaryDirectory[str]:
    """Return a folder for kernels of this process alone, which is removed when it ends."""
    return TemporaryDirectory(prefix="twillight-kernels-")


_CACHE = _cache_home()


class _ByContent(UserProvidedCacheLocator):
    """Place of a kernel in the cache."""

    def __init__(self, function: Callable[..., Any], path: str) -> None:
        super().__init__(function, path)  # type: ignore[no-untyped-call]
        self._cache_path = str(_cache_folder(function.__module__, Path(path)))

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> _ByContent:
        return cls(py_func, py_file)


class _KernelCacheFormat(CompileResultCacheImpl):
    _locator_classes = [_ByContent]  # noqa: RUF012, numba's own declaration


class _KernelCache(FunctionCache):
    """Compiled forms of a kernel: one that Python can call, and one for other kernels, without machine code."""

    _impl_class = _KernelCacheFormat
    for_kernels = False

    def _index_key(self, sig: Any, codegen: Any) -> tuple[Any, ...]:
        return (*super()._index_key(sig, codegen), self.for_kernels)  # type: ignore[no-untyped-call]


make_reproducible()

_listeners: list[Callable[[str], None]] = []
_compiling: list[str] = []  # kernels that wait for those that they call


@contextmanager
def announced(ready: Callable[[str], None]) -> Iterator[None]:
    """Call `ready` with the name of every kernel that this process compiles, or reads from the cache, meanwhile."""
    _listeners.append(ready)
    try:
        yield
    finally:
        _listeners.remove(ready)


def _decorator(allocates: bool = False, **flags: Any) -> Callable[[_Function], _Function]:
    """Return a decorator with these flags; each kernel is compiled or read by one process at a time.

    numba counts references to every slice of an array, with two locked instructions each: up to 70 % of the time of a
    point. A kernel that makes no array borrows its caller's, so it needs no counts (`_nrt`). The caller holds the
    arrays while it runs. An array must not leave such a kernel: its caller would release what was never counted.
    """
    # Nothing calls kernels from C, and the functions for it took a tenth of the time of compiling.
    flags |= {"_nrt": allocates, "no_cfunc_wrapper": True}
    compiled = numba.njit(nogil=True, error_model="numpy", **flags)

    def decorate(function: _Function) -> _Function:
        dispatcher: Any = compiled(function)
        cache = dispatcher._cache = _KernelCache(function)  # type: ignore[no-untyped-call]
        folder = Path(cache.cache_path)
        compile_or_load, add_overload = dispatcher.compile, dispatcher.add_overload
        for_kernels: set[Any] = set()
        name = f"{function.__module__}.{function.__qualname__}-{function.__code__.co_firstlineno}"

        def add(result: Any) -> None:
            if cache.for_kernels:
                dispatcher.overloads[result.signature.args] = result
                for_kernels.add(result.signature.args)
            else:
                add_overload(result)

        def compile_alone(signature: Any) -> Any:
            # This process's compiler first, then the kernel's file; a process that dies releases both.
            with global_compiler_lock:
                folder.mkdir(parents=True, exist_ok=True)
                cache.for_kernels = dispatcher.targetoptions["no_cpython_wrapper"] = bool(_compiling)
                if not _compiling and signature in for_kernels:
                    for_kernels.remove(signature)
                    del dispatcher.overloads[signature]
                _compiling.append(name)
                collecting = gc.isenabled()
                gc.disable()  # the collector of cycles took an eighth of the time of compiling
                try:
                    # A lock made before a fork would refuse to work in the child.
                    with FileLock(folder / f"{name}.lock", thread_local=False):
                        result = compile_or_load(signature)
                finally:
                    _compiling.pop()
                    if collecting:
                        gc.enable()
            returned = list(dispatcher.overloads.values())[-1].signature.return_type
            if not allocates and _holds_array(returned):
                raise TypeError(f"{name} returns {returned}: it must be an allocating_kernel")
            for listener in _listeners:
                listener(name)
            return result

        dispatcher.compile, dispatcher.add_overload = compile_alone, add
        return cast(_Function, dispatcher)

    return decorate


def _holds_array(type_: Any) -> bool:
    """Return whether a numba type is an array, or a tuple that holds one."""
    if isinstance(type_, numba.types.BaseTuple):
        return any(_holds_array(inner) for inner in type_.types)  # type: ignore[attr-defined]
    return isinstance(type_, numba.types.Array)


_REGROUPED = {"reassoc", "contract", "nsz", "arcp"}

kernel = _decorator()  # decorator of compiled functions that neither make nor return an array

allocating_kernel = _decorator(allocates=True)
"""Decorator of compiled functions that make or return arrays; `kernel` would not compile, or refuse.

They count references to slices: a loop over queries belongs in a `kernel` that they call with their arrays.
"""

fast_kernel = _decorator(fastmath=_REGROUPED)
"""Decorator of the few flat loops in single precision that vector units must be free to sum in their own order.

NaN and infinity keep their meaning. Sums differ in the last bits between processors of different vector width, never
between runs, workers or orders on one, nor between who compiles a kernel and who reads it from the cache.
"""

fused_kernel = _decorator(fastmath={"contract"})
"""Decorator of arithmetic that must not be regrouped; a product and a sum may be one instruction, rounded once."""

inlined_kernel = _decorator(forceinline=True)
"""Decorator of functions called once a point with many tables: a call would copy what it passes."""

inlined_fast_kernel = _decorator(fastmath=_REGROUPED, forceinline=True)
"""Decorator of what such a loop calls for every node: a call would keep it from the vector units."""
