"""The terminal: tables and sentences are printed by it, and nothing in them is obeyed.

Names, sources and messages come from files of others. Characters that a terminal would obey, such as those that move
the cursor or set its title, are replaced, and brackets and colons mean themselves.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment

from weaves.errors import printable


class Terminal(Console):
    """A rich console that shows text as it is; without markup, emoji codes and highlighted words.

    Parameters
    ----------
    stderr : bool
        Write to stderr.
    """

    def __init__(self, *, stderr: bool = False, **options: Any) -> None:
        super().__init__(stderr=stderr, markup=False, emoji=False, highlight=False, **options)

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Yield the segments of anything that can be shown; rich's own control segments stay."""
        for text, style, control in super().render(renderable, options):
            yield Segment(text if control else printable(text), style, control)
