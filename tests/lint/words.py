"""Words of the code: names use the field's terms, and docstrings open with a noun or an imperative."""

import re
from collections.abc import Iterator

from tests.lint.tree import DOORS, MODULES, Source

NAMES = {
    "knob": "parameter", "teacher": "trained_by", "verdict": "result", "contradictions": "validation",
    "leftovers": "fallback_share", "errs": "error", "elliptic": "auto", "oblique": "rotated",
    "placed": "nodes placed in the footprint", "stand_in": "fallback", "left_to": "fallback",
    "not_its_own": "fallback_share",
}  # fmt: skip
"""Words that are no part of any name, and the term to use."""

OPENINGS = re.compile(r"(What|Say|Says|Tell|Tells|Whether)\b")
"""Openings of docstrings that are neither a noun nor an imperative of the field; bools open with "True if"."""

PROSE = {
    "asked": "query, evaluate", "asks": "query, evaluate", "taught": "trained on", "told": "report, receive",
    "errs": "error", "teacher": "trained_by", "knob": "parameter", "leftovers": "fallback_share",
}  # fmt: skip
"""Words that are not in docstrings and comments outside of code spans, and the terms to use."""


def names(source: Source) -> set[str]:
    """Return every name that a file defines, binds or uses, in small letters, and its own."""
    values = (getattr(node, key, None) for node in source.nodes for key in ("id", "attr", "arg", "name"))
    return {value.lower() for value in values if isinstance(value, str)} | {source.path.stem}


def wrong_names(name: str) -> Iterator[str]:
    for word, term in NAMES.items():
        if f"_{word}_" in f"_{name}_" or f"_{word}s_" in f"_{name}_":
            yield f"the name {name}: use {term}"


def wrong_prose(text: str) -> Iterator[str]:
    for word in re.findall(r"\w+", re.sub(r"`[^`]*`", "", text).lower()):
        if word in PROSE:
            yield f"the word {word}: use {PROSE[word]}"


def problems() -> Iterator[str]:
    """Yield a sentence for every word that is not the field's."""
    for source in (*DOORS, *MODULES.values()):
        wrong = [sentence for name in sorted(names(source)) for sentence in wrong_names(name)]
        wrong += [sentence for text in source.prose for sentence in wrong_prose(text)]
        openings = [text.value for text in source.strings if OPENINGS.match(text.value)]
        wrong += [f"a docstring opens with {text.splitlines()[0]!r}: use a noun or an imperative" for text in openings]
        yield from (f"{source.name}: {sentence}" for sentence in wrong)
