import hashlib

import pytest

from pipeline.fingerprint import canonical, fingerprint


def test_known_bytes():
    assert canonical({"b": (1.0, 0.5), "a": {"d": "ä", "c": None}}) == b'{"a":{"c":null,"d":"\\u00e4"},"b":[1,0.5]}'
    assert fingerprint([1], 64) == hashlib.sha256(b"[1]").hexdigest()


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_numbers_that_are_none_are_refused(value):
    with pytest.raises(ValueError, match="JSON"):
        fingerprint([value])
