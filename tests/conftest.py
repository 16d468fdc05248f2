"""Order of the tests: the longest one starts first, so that no core waits for it at the end."""

_FIRST = "tests/jobs/test_smoke.py"


def pytest_collection_modifyitems(items):
    items.sort(key=lambda item: not item.nodeid.startswith(_FIRST))
