"""TOML as it is written is read again as what it was."""

import tomllib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jobs.verbs.toml_text import toml

TEXT = st.text(st.characters(exclude_categories=("Cs",)), max_size=8)
VALUES = st.one_of(TEXT, st.booleans(), st.integers(-(2**63), 2**63 - 1), st.floats(allow_nan=False))
TABLES = st.recursive(
    st.dictionaries(TEXT, VALUES, max_size=3),
    lambda inner: st.dictionaries(
        TEXT, st.one_of(VALUES, st.lists(VALUES, max_size=3), inner, st.lists(inner)), max_size=3
    ),
    max_leaves=12,
)


@settings(max_examples=200, deadline=None)
@given(TABLES)
def test_what_was_written_is_read_again(table):
    assert tomllib.loads(toml(table)) == table


@pytest.mark.parametrize("text", ['a\x7f\x00"\\\n', "\U0001f9f6", "é"])
def test_characters_that_json_and_toml_write_differently(text):
    assert tomllib.loads(toml({text: [text]})) == {text: [text]}


def test_nothing_is_left_out_but_none():
    assert tomllib.loads(toml({"a": None, "b": [{"c": 1, "d": None}], "e": [1, {"f": None}]})) == {
        "b": [{"c": 1}],
        "e": [1, {}],
    }
