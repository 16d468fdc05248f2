"""Errors for the user: bad input, and work that failed.

Each carries one sentence. The command line prints it without a traceback and exits with `exit_code`. Files, keys and
values in it come from outside: they are shortened, and characters that a terminal would obey are replaced.
"""

from __future__ import annotations

import difflib
import reprlib
from collections.abc import Iterable
from typing import Final

MOST_LETTERS: Final = 300  # most letters of a sentence
_PART = 80  # letters of a file, a key or a value in it


class BadInput(ValueError):  # noqa: N818 - the name reads as the sentence does
    """Input that cannot be used; exit code 2.

    `where` is the file or command that holds the value, `key` its dotted path, empty when the whole file is meant;
    `allowed` is what is allowed, as the end of a sentence.
    """

    exit_code = 2

    def __init__(self, where: str, key: str, value: object, allowed: str) -> None:
        self.where, self.key, self.value, self.allowed = where, key, value, allowed
        place = one_line(where, _PART, keep="end")
        subject = f"{one_line(key, _PART)} = {brief(value)}" if key else one_line(value, 180)
        super().__init__(one_line(f"{place}: {subject}: {allowed}"))

    def __reduce__(self) -> tuple[type[BadInput], tuple[str, str, object, str]]:
        # Exceptions cross process borders; the default would rebuild this one from its sentence alone.
        return type(self), (self.where, self.key, self.value, self.allowed)


class WorkFailed(RuntimeError):  # noqa: N818 - the name reads as the sentence does
    """Work that failed on valid input; exit code 1."""

    exit_code = 1


def one_line(text: object, most: int = MOST_LETTERS, keep: str = "start") -> str:
    """Return a text, or the `str` of anything else, as one line of at most so many letters, as a terminal shows it.

    Of a longer text the ``start`` or the ``end`` is kept: the end of a path has the file's name.
    """
    words = str(text)
    cut = words[: 4 * most] if keep == "start" else words[-4 * most :]  # whatever its length, in little time
    line = " ".join(printable(cut).split())
    if len(line) <= most and len(cut) == len(words):
        return line
    return f"{line[: most - 1]}…" if keep == "start" else f"…{line[1 - most :]}"


def brief(value: object) -> str:
    """Return the `repr` of a value, shortened to 80 letters."""
    return one_line(_BRIEF.repr(value), _PART)


class _Brief(reprlib.Repr):
    """Short forms of values, however deep, long or large."""

    def __init__(self) -> None:
        super().__init__()
        self.maxlevel, self.maxlist, self.maxtuple, self.maxdict = 3, 8, 8, 4
        self.maxstring = self.maxother = self.maxlong = 60

    def repr_int(self, value: int, level: int) -> str:
        """Python refuses to write integers of thousands of digits."""
        return super().repr_int(value, level) if value.bit_length() < 1000 else f"<{value.bit_length()} bits>"


_BRIEF = _Brief()


def printable(text: str) -> str:
    """Return a text without characters that a terminal would obey: a dot stands for each of them."""
    return text if text.isprintable() else "".join(one if one.isprintable() or one in "\n\t" else "·" for one in text)


def nearest(word: str, known: Iterable[str]) -> str:
    """Return the end of a sentence: ``"did you mean 'x'? known: a, b, x"``, or only its last part if none is near."""
    names = sorted(known)
    close = difflib.get_close_matches(word[:60], names, n=1, cutoff=0.6)
    suggestion = f"did you mean {close[0]!r}? " if close else ""
    return f"{suggestion}known: {', '.join(names)}"
