"""The terminal: tables, sentences and bars are printed by it, and nothing in them is obeyed.

Names, sources and messages come from files of others. Characters that a terminal would obey, such as those that move
the cursor or set its title, are replaced, and brackets and colons mean themselves.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from types import MappingProxyType
from typing import Any, Final, TypeVar

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.table import Table

from weaves.errors import printable

Item = TypeVar("Item")

_WIDEST: Final = 4096  # letters of a row where it is not shown on a terminal
MOST_SENTENCES: Final = 20  # most sentences of one kind that a verb prints; it counts the others


class Terminal(Console):
    """A rich console that shows text as it is: without markup, emoji codes and highlighted words."""

    def __init__(self, *, stderr: bool = False, **options: Any) -> None:
        super().__init__(stderr=stderr, markup=False, emoji=False, highlight=False, **options)

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Yield the segments of anything that can be shown; rich's own control segments stay."""
        for text, style, control in super().render(renderable, options):
            yield Segment(text if control else printable(text), style, control)

    def on_broken_pipe(self) -> None:
        """Leave the closed reader to `jobs.exits`; rich would end with exit code 1."""
        raise


def print_lines(*sentences: object, stderr: bool = False) -> None:
    """Print sentences as they are, each in one line."""
    for sentence in sentences:
        Terminal(stderr=stderr).print(str(sentence), soft_wrap=True)


def print_table(
    columns: Sequence[str],
    rows: Iterable[Sequence[object]],
    *,
    text: Sequence[str] = (),
    title: str = "",
    caption: str = "",
    styles: Mapping[int, str] = MappingProxyType({}),
    gap: int = 2,
) -> None:
    """Print a table, whose first column labels the rows.

    Columns in `text` hold words, others numbers, which stand on the right. `styles` are those of single rows, by their
    number; `gap` are the letters between columns. A file or a pipe takes rows of any width.
    """
    table = Table(box=None, pad_edge=False, header_style="bold", padding=(0, gap, 0, 0))
    table.title, table.title_justify = title or None, "left"
    table.caption, table.caption_justify = caption or None, "left"
    for index, column in enumerate(columns):
        table.add_column(column, justify="right" if index and column not in text else "left")
    for index, row in enumerate(rows):
        table.add_row(*map(str, row), style=styles.get(index))
    console = Terminal()
    console.width = console.width if console.is_terminal else _WIDEST
    console.print(table)


@contextmanager
def progress(doing: str) -> Iterator[Callable[[float], None]]:
    """Show a bar on a terminal while work is done; yield what takes the share that is done."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    console = Terminal(stderr=True)
    columns = TextColumn(doing), BarColumn(), TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn()
    with Progress(*columns, console=console, disable=not console.is_terminal, transient=True) as bars:
        bar = bars.add_task(doing, total=1.0)
        yield lambda share: bars.update(bar, completed=share)


def tracked(items: Sequence[Item], doing: str) -> Iterator[Item]:
    """Yield items, with a bar on a terminal."""
    with progress(doing) as advance:
        for index, item in enumerate(items):
            yield item
            advance((index + 1) / len(items))


def duration(seconds: float) -> str:
    """Write a time as a person would say it."""
    if seconds < 120:
        return f"{seconds:.0f} s"
    if seconds < 2 * 3600:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h" if seconds < 48 * 3600 else f"{seconds / 86400:.1f} days"


def size(count: float) -> str:
    """Write a number of bytes."""
    for unit in ("B", "kB", "MB", "GB"):
        if count < 1000:
            return f"{count:.3g} {unit}"
        count /= 1000
    return f"{count:.3g} TB"


def number(value: float) -> str:
    """Write a measured number with three digits; a missing one as a dash."""
    if value != value:
        return "–"
    if 0 < abs(value) < 0.01:
        return f"{value:.1e}"
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"
