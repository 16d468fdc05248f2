import io
import json

import pytest
from rich.console import Console

from jobs.plan import estimate
from jobs.plan.estimate import Estimate
from jobs.run import progress, progress_forms
from jobs.run.progress import Board
from jobs.run.progress_forms import form_of


@pytest.fixture
def fake(monkeypatch, request):
    monkeypatch.syspath_prepend(request.path.parents[1])
    import fake_stages

    return fake_stages


class Clock:
    def __init__(self, monkeypatch):
        self.now = 0.0
        for module in (progress, progress_forms, estimate):
            monkeypatch.setattr(module.time, "monotonic", lambda: self.now)


@pytest.fixture
def clock(monkeypatch):
    return Clock(monkeypatch)


KEYS = {
    *("event", "time", "task", "stage", "title", "share", "message", "done", "total", "failed", "rate"),
    *("seconds_left", "workers", "dashboard"),
}


def run(fake, clock, form):
    """Show a run of four equal shards on a stepped clock: one is done, one fails, one is tried again."""
    out = io.StringIO()
    tasks = [fake.task(f"shard {index}") for index in range(4)]
    times = Estimate()
    with Board(tasks, times, form_of(form, Console(file=out, width=200))) as board:
        board.compiling(0, 1, ["owen"])
        board.hear({"kernel": "slab"})
        board.compiling(1, 1, [])
        board.start(2, "http://here:8787/status")
        for task in tasks:
            board.begin(task)
        clock.now = 10.0
        times.learn(tasks[0], 10.0)
        board.end(tasks[0])
        clock.now = 20.0
        board.end(tasks[1], "[the] disk was full")
        clock.now = 24.0
        board.hear({"task": tasks[2].id, "share": 0.5})
        clock.now = 30.0
        board.end(tasks[2], "OSError: once", again=True)
        board.say("nothing new")
    return tasks, out.getvalue()


def test_json_has_one_object_a_line_with_the_same_keys(fake, clock):
    tasks, text = run(fake, clock, "json")
    lines = [json.loads(line) for line in text.splitlines()]
    assert all(set(line) == KEYS for line in lines)
    events = [line["event"] for line in lines]
    assert events[0] == "compile" and events[-1] == "stop"
    assert [event for event in events if event != "compile"] == [
        *("start", "begin", "begin", "begin", "begin", "end", "failed", "progress", "again", "message", "stop")
    ]
    by = {line["event"]: line for line in lines}
    assert by["start"]["total"] == 4 and by["start"]["dashboard"] == "http://here:8787/status"
    # Four tasks of one cost each, on two workers.
    assert by["start"]["seconds_left"] == 2.0 and by["start"]["workers"] == 2
    assert (by["end"]["task"], by["end"]["stage"], by["end"]["title"]) == (tasks[0].id, "generate", "shard 0")
    assert (by["end"]["done"], by["end"]["rate"]) == (1, 0.1)
    assert (by["failed"]["done"], by["failed"]["failed"]) == (1, 1)
    assert by["failed"]["message"] == "[the] disk was full"
    # The third is half done after 24 s, so it goes on for 24 s.
    assert (by["progress"]["share"], by["progress"]["seconds_left"]) == (0.5, 24.0)
    # What is tried again counts as not begun.
    assert by["again"]["message"] == "OSError: once" and 1.0 < by["again"]["seconds_left"] <= 11.0


def test_lines_have_failures_rate_time_left_and_dashboard(fake, clock):
    _, text = run(fake, clock, "plain")
    lines = text.splitlines()
    assert lines[0].startswith("compiling kernels: ")
    assert "4 tasks (generate 4) on 2 workers; dashboard: http://here:8787/status" in lines
    assert "failed: generate shard 1: [the] disk was full" in lines
    assert "again: generate shard 2: OSError: once" in lines
    assert lines[-1] == "nothing new"
    out = io.StringIO()
    tasks = [fake.task(f"shard {index}") for index in range(4)]
    with Board(tasks, Estimate(), form_of("plain", Console(file=out, width=200))) as board:
        board.start(1, None)
        for task in tasks:
            board.begin(task)
            clock.now += 20.0
            board.end(task, "why" if task is tasks[2] else "")
    shown = [line for line in out.getvalue().splitlines() if " of " in line]
    assert shown[0] == "generate 2 of 4 tasks; all 2 of 4, 3 tasks/min, 0:00:02 left"
    assert shown[-1] == "generate 4 of 4 tasks; all 4 of 4, 1 failed, 3 tasks/min, 0:00:00 left"


def test_bars_have_failures_rate_and_dashboard(fake, clock):
    _, text = run(fake, clock, "rich")
    assert "dashboard: http://here:8787/status" in text
    assert "2/4 tasks, 1 failed" in text and "4 tasks/min" in text


def test_auto_shows_bars_on_a_terminal_alone():
    terminal = Console(file=io.StringIO(), force_terminal=True)
    assert form_of("auto", terminal).__func__ is form_of("rich", terminal).__func__
    log = Console(file=io.StringIO())
    assert form_of("auto", log).__func__ is form_of("plain", log).__func__
