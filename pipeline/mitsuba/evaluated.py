"""Loops and calls of Dr.Jit that are evaluated at once, not recorded: NumPy answers queries, and cannot be recorded.

They are so inside `evaluated` only: there Mitsuba's `aov` gives wrong normals, and `path` loses light (version 3.9.1).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Final

FLAGS: Final = ("SymbolicCalls", "SymbolicLoops", "SymbolicConditionals")
"""Flags of Dr.Jit that are off inside."""


@contextmanager
def evaluated() -> Iterator[None]:
    """Evaluate loops and calls inside; the integrator `twillight_path` does so itself, others need it around them.

    Examples
    --------
    >>> import mitsuba as mi
    >>> mi.set_variant("scalar_rgb")
    >>> with evaluated():
    ...     pass  # mi.render(scene, integrator=mi.load_dict({"type": "path"}))
    """
    import drjit as dr

    with ExitStack() as stack:
        for name in FLAGS:
            stack.enter_context(dr.scoped_set_flag(getattr(dr.JitFlag, name), False))
        yield
