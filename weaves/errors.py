"""Errors for the user: bad input, and work that failed.

Each carries one sentence. The command line prints it without a traceback and exits with `exit_code`.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable

from weaves.renamed import replacement


class BadInput(ValueError):  # noqa: N818 - the name reads as the sentence does
    """Input that cannot be used; exit code 2.

    Parameters
    ----------
    where : str
        The file or command that holds the value.
    key : str
        Dotted path of the key; empty when the whole file is meant.
    value : object
        The value found.
    allowed : str
        What is allowed, as the end of a sentence.
    """

    exit_code = 2

    def __init__(self, where: str, key: str, value: object, allowed: str) -> None:
        self.where, self.key, self.value, self.allowed = where, key, value, allowed
        subject = f"{where}: {key} = {value!r}" if key else f"{where}: {value}"
        super().__init__(f"{subject}: {allowed}")

    def __reduce__(self) -> tuple[type[BadInput], tuple[str, str, object, str]]:
        # Exceptions cross process borders; the default would rebuild this one from its sentence alone.
        return type(self), (self.where, self.key, self.value, self.allowed)


class WorkFailed(RuntimeError):  # noqa: N818 - the name reads as the sentence does
    """Work that failed on valid input; exit code 1."""

    exit_code = 1


def nearest(word: str, known: Iterable[str], kind: str = "") -> str:
    """Return the known name that was probably meant, as the end of a sentence.

    Parameters
    ----------
    word : str
        The name found.
    known : iterable of str
        Names that are allowed.
    kind : str
        Kind of the name in `weaves.renamed`; empty if names of this kind never changed.

    Returns
    -------
    str
        ``"did you mean 'x'? known: a, b, x"``, without its first part if no name is near; for a name of an earlier
        version ``"'old' is now 'x'"``.
    """
    names = sorted(known)
    if new := replacement(kind, word):
        return new
    close = difflib.get_close_matches(word, names, n=1, cutoff=0.5)
    suggestion = f"did you mean {close[0]!r}? " if close else ""
    return f"{suggestion}known: {', '.join(names)}"
