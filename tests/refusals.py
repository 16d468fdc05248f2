"""Refusals of bad input: one short sentence."""

import pytest

from weaves.errors import MOST_LETTERS, BadInput


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
