"""Refusals of bad input: one short sentence."""

import signal
from contextlib import contextmanager

import pytest

from weaves.errors import MOST_LETTERS, BadInput


@contextmanager
def ends(seconds=300):
    """Fail, rather than wait, where a reader does not return; so long is far above what any takes."""

    def late(number, frame):
        raise AssertionError(f"it takes more than {seconds} s")

    signal.signal(signal.SIGALRM, late)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)


def sentence_of(refused):
    sentence = str(refused)
    assert 0 < len(sentence) <= MOST_LETTERS and sentence.isprintable(), sentence
    return sentence


def refusal(call, *arguments, **options):
    """Return the sentence with which a call refuses its arguments."""
    with pytest.raises(BadInput) as refused:
        call(*arguments, **options)
    return sentence_of(refused.value)


def accepted(call, *arguments):
    """Return the result of a call, or None if it refuses its arguments in one short sentence."""
    try:
        return call(*arguments)
    except BadInput as refused:
        sentence_of(refused)
