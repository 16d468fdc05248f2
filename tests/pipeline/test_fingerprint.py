import hashlib

import pytest

from pipeline.fingerprint import canonical, fingerprint, fingerprints


def test_known_bytes_and_many_that_differ_in_some_integers_are_those_of_each():
    assert canonical({"b": (1.0, 0.5), "a": {"d": "ä", "c": None}}) == b'{"a":{"c":null,"d":"\\u00e4"},"b":[1,0.5]}'
    assert fingerprint([1], 64) == hashlib.sha256(b"[1]").hexdigest()
    specification = {"b": [1.0, 0.5], "start": 3, "a": {"start": "ä", "c": None}, "~": "x"}
    changes = [{"start": 10**12}, {"start": 0, "rows": -1}, {}]
    each = [fingerprint(["kind", specification | change]) for change in changes]
    assert list(fingerprints("kind", specification, changes)) == each


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_numbers_that_are_none_are_refused(value):
    with pytest.raises(ValueError, match="JSON"):
        fingerprint([value])
