import asyncio

import pytest

from pipeline import patience


class LastingError(Exception):
    pass


class Clock:
    """A clock that only pauses move."""

    def __init__(self):
        self.now, self.pauses = 1000.0, []

    async def sleep(self, seconds):
        self.now += seconds
        self.pauses.append(seconds)


@pytest.fixture
def clock(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(patience.time, "monotonic", lambda: clock.now)
    monkeypatch.setattr(patience.asyncio, "sleep", clock.sleep)
    return clock


@pytest.fixture
def said(monkeypatch):
    monkeypatch.setattr(patience, "_state", patience._State())
    said = []
    patience.tell(said.append)
    return said


def ask(request, kind="answered"):
    return asyncio.run(patience.patiently(request, lambda error: "final" if isinstance(error, LastingError) else kind))


def failing(times, error=ConnectionError):
    """Return a request that fails so many times, and the list of its calls."""
    calls = []

    async def request():
        calls.append(None)
        if len(calls) <= times:
            raise error("503 Slow Down")
        return "answer"

    return request, calls


def test_a_request_is_repeated_with_growing_pauses_until_it_is_answered(clock, said):
    request, calls = failing(9)
    assert ask(request) == "answer"
    assert len(calls) == 10
    assert clock.pauses == sorted(clock.pauses) and clock.pauses[0] < 1 and clock.pauses[-1] == 10
    assert len(said) == 1 and "503 Slow Down" in said[0] and "10 minutes at most" in said[0]


def test_a_failure_is_said_again_only_after_a_minute_without_one(clock, said):
    ask(failing(3)[0])
    clock.now += 50
    ask(failing(3)[0])
    assert len(said) == 1
    clock.now += 61
    ask(failing(3)[0])
    assert len(said) == 2


def test_it_gives_up_after_ten_minutes_and_then_at_once_until_the_storage_answers(clock, said):
    begun = clock.now
    with pytest.raises(patience.StorageFailed, match=r"failed for 10 minutes \(503 Slow Down\); finished work is kept"):
        ask(failing(10**6)[0])
    assert 600 <= clock.now - begun <= 610
    clock.pauses.clear()
    with pytest.raises(patience.StorageFailed, match="still fails"):
        ask(failing(10**6)[0])
    assert clock.pauses == []
    ask(failing(0)[0])
    assert ask(failing(9)[0]) == "answer"


def test_a_storage_that_never_answered_is_given_up_soon(clock, said):
    begun = clock.now
    with pytest.raises(patience.StorageFailed, match="cannot be reached"):
        ask(failing(10**6)[0], "unreached")
    assert clock.now - begun < 10 and not said


def test_an_error_that_would_come_again_is_raised_at_once(clock, said):
    with pytest.raises(LastingError):
        ask(failing(1, LastingError)[0])
    assert clock.pauses == [] and not said


def test_one_that_answered_a_process_of_the_run_is_waited_for(clock, said):
    patience.expect()
    assert ask(failing(20)[0], "unreached") == "answer"
    assert len(said) == 1
