"""numba's compiler, made a function of the sources: what a kernel computes depends on no process and no order.

Compiled code holds copies of what it calls, all optimised together in their new place. numba 0.61 to 0.68 let four
things that are no part of a function decide about its bits:

- which copy of a callee runs: the linker takes the first that the process loaded (`_SelfContained`);
- whether a callee was compiled here or read from the cache, as code generation had rewritten it (`_SelfContained`);
- the flags of whoever calls a function first, which the function then keeps for all (`_OwnFlags`);
- the flags of whoever first uses an operation that numba writes in Python, such as `x**2` (`_compile_subroutine`).

With reassociation allowed, each of the four changes the last bits of sums. These are numba's internals;
tests/pipeline/compiled/test_decorators.py fails when an upgrade makes one of them void.
"""

from __future__ import annotations

from typing import Any

from llvmlite import binding
from numba.core.base import BaseContext
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
from numba.core.cpu import CPUTargetOptions
from numba.core.registry import cpu_target

_INHERITED = ("fastmath", "forceinline")


class _SelfContained(JITCodeLibrary):
    """A compiled function that runs its own copies of what it calls, and is to its callers what the cache holds.

    Machine code is made, or taken from the cache, when its address is first needed: what only kernels call has none.
    """

    _loaded = False

    def _optimize_final_module(self) -> None:
        """Wait until Python calls it: to optimise every callee alone as well took a fifth of the time of compiling."""

    def _finalize_final_module(self) -> None:
        self._shared_module = self._for_callers()
        self._compiled_object, self._finalized = b"", True

    def get_pointer_to_function(self, name: str) -> Any:
        self._ensure_finalized()  # type: ignore[no-untyped-call]
        if not self._loaded and any(function.name == name for function in _defined(self._shared_module)):
            self._loaded = True
            if not self._compiled_object:
                super()._optimize_final_module()  # type: ignore[no-untyped-call]
            for function in _defined(self._final_module, binding.Linkage.linkonce_odr):
                function.linkage = binding.Linkage.internal
            super()._finalize_final_module()  # type: ignore[no-untyped-call]
            self._codegen._engine._load_defined_symbols(self._shared_module)  # type: ignore[no-untyped-call]
        return super().get_pointer_to_function(name)  # type: ignore[no-untyped-call]

    @classmethod
    def _unserialize(cls, codegen: Any, state: tuple[str, str, tuple[bytes, bytes]]) -> _SelfContained:
        name, _, (machine_code, bitcode) = state
        self: _SelfContained = codegen.create_library(name)
        self.enable_object_caching()  # type: ignore[no-untyped-call]
        self._set_compiled_object(machine_code)  # type: ignore[no-untyped-call]
        self._shared_module, self._finalized = binding.parse_bitcode(bitcode), True
        return self

    def _for_callers(self) -> binding.ModuleRef:
        """Return the code before it is optimised as a whole, by way of bytes like all that is cached."""
        shared = self._final_module.clone()
        for function in _defined(shared, binding.Linkage.external):
            function.linkage = binding.Linkage.linkonce_odr
        return binding.parse_bitcode(shared.as_bitcode())


def _defined(module: binding.ModuleRef, linkage: binding.Linkage | None = None) -> list[binding.ValueRef]:
    """Return the functions that a module defines, of this linkage if there is one."""
    functions = [function for function in module.functions if not function.is_declaration]
    return [function for function in functions if linkage is None or function.linkage == linkage]


class _OwnFlags(CPUTargetOptions):
    """Options of a function: options that it does not set are off, whatever its first caller has."""

    def finalize(self, flags: Any, options: Any) -> None:
        for name in _INHERITED:
            # Reading gives the default; what is set is not inherited.
            setattr(flags, name, getattr(flags, name))
        super().finalize(flags, options)  # type: ignore[no-untyped-call]


_compile_subroutine: Any = BaseContext.compile_subroutine
_subroutines: dict[frozenset[str], dict[Any, Any]] = {}


def _compile_by_flags(self: BaseContext, *arguments: Any, **keywords: Any) -> Any:
    """Compile what numba writes in Python itself, once for each set of flags instead of once for all.

    The flags are those of fast mathematics, and whether references to arrays are counted.
    """
    flags = frozenset({*getattr(self.fastmath, "flags", ()), *(("nrt",) if self.enable_nrt else ())})
    self.cached_internal_func = _subroutines.setdefault(flags, {})
    return _compile_subroutine(self, *arguments, **keywords)


_set_env: Any = JITCPUCodegen.set_env


def _set_env_of_loaded(self: Any, name: str, env: Any) -> None:
    """Set the environment of a function that has machine code: LLVM ends a process that looks for another's."""
    if self._engine.is_symbol_defined(name):
        _set_env(self, name, env)


def make_reproducible() -> None:
    """Replace these parts of numba's compiler in this process, before anything is compiled."""
    cpu_target.target_context.codegen()._library_class = _SelfContained
    cpu_target.options = _OwnFlags
    BaseContext.compile_subroutine = _compile_by_flags  # type: ignore[method-assign]
    JITCPUCodegen.set_env = _set_env_of_loaded  # type: ignore[method-assign]
