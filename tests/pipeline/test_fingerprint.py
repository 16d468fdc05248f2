"""Canonical bytes: the same specification, the same fingerprint."""

import hashlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.fingerprint import canonical, file_sha256, fingerprint

JSON = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**53), 2**53)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(),
    lambda children: st.lists(children, max_size=4) | st.dictionaries(st.text(), children, max_size=4),
    max_leaves=10,
)


@given(st.dictionaries(st.text(), JSON, max_size=6))
def test_key_order_does_not_matter(specification):
    assert fingerprint(dict(reversed(specification.items()))) == fingerprint(specification)


def test_known_bytes():
    assert canonical({"b": (1.0, 0.5), "a": "ä"}) == b'{"a":"\\u00e4","b":[1,0.5]}'
    assert fingerprint([1], 64) == hashlib.sha256(b"[1]").hexdigest()


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_numbers_that_are_none_are_refused(value):
    with pytest.raises(ValueError, match="JSON"):
        fingerprint([value])


def test_file_hash(tmp_path):
    (tmp_path / "f").write_bytes(b"abc")
    assert file_sha256(tmp_path / "f") == hashlib.sha256(b"abc").hexdigest()
