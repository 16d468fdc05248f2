import io
import json
from types import SimpleNamespace

import pytest
from rich.console import Console

from jobs.plan import schedule
from jobs.plan.schedule import Estimate
from jobs.run import progress, progress_forms
from jobs.run.progress import Board
from jobs.run.progress_forms import form_of
from tests.jobs import fake_stages as fake


@pytest.fixture
def clock(monkeypatch):
    clock = SimpleNamespace(now=0.0)
    for module in (progress, progress_forms, schedule):
        monkeypatch.setattr(module.time, "monotonic", lambda: clock.now)
    return clock


TASKS = [fake.task(f"shard {index}") for index in range(4)]

KEYS = {"event", "time", "task", "stage", "title", "share", "message", "done", "total", "failed", "rate", "workers"}
KEYS |= {"seconds_left", "dashboard"}


def run(clock, form):
    """Return what is shown of four equal shards on a stepped clock: one is done, one fails, one is tried again."""
    out = io.StringIO()
    with Board(TASKS, Estimate(), form_of(form, Console(file=out, width=200))) as board:
        board.compiling(0, 1, ["owen"])
        board.hear({"kernel": "slab"})
        board.compiling(1, 1, [])
        board.start(2, "http://here:8787/status")
        for task in TASKS:
            board.begin(task)
        clock.now = 10.0
        board.end(TASKS[0], seconds=10.0)
        clock.now = 20.0
        board.end(TASKS[1], "[the] disk was full")
        clock.now = 24.0
        board.hear({"task": TASKS[2].id, "share": 0.5})
        clock.now = 30.0
        board.end(TASKS[2], "OSError: once", again=True)
        board.say("nothing new")
    return out.getvalue()


def test_json_has_one_object_a_line_with_the_same_keys(clock):
    lines = [json.loads(line) for line in run(clock, "json").splitlines()]
    assert all(set(line) == KEYS for line in lines)
    events = [line["event"] for line in lines]
    assert events[0] == "compile" and events[-1] == "stop"
    rest = ["start", *["begin"] * 4, "end", "failed", "progress", "again", "message", "stop"]
    assert [event for event in events if event != "compile"] == rest
    by = {line["event"]: line for line in lines}
    assert by["start"]["total"] == 4 and by["start"]["dashboard"] == "http://here:8787/status"
    # Four tasks of one cost each, on two workers.
    assert by["start"]["seconds_left"] == 2.0 and by["start"]["workers"] == 2
    assert (by["end"]["task"], by["end"]["stage"], by["end"]["title"]) == (TASKS[0].id, "generate", "shard 0")
    assert (by["end"]["done"], by["end"]["rate"]) == (1, 0.1)
    assert (by["failed"]["done"], by["failed"]["failed"]) == (1, 1)
    assert by["failed"]["message"] == "[the] disk was full"
    # The third is half done after 24 s, so it goes on for 24 s.
    assert (by["progress"]["share"], by["progress"]["seconds_left"]) == (0.5, 24.0)
    # What is tried again counts as not begun; the other one, 30 s beyond its estimate, goes on for half of them.
    assert by["again"]["message"] == "OSError: once" and by["again"]["seconds_left"] == 15.0


def test_lines_have_failures_rate_time_left_and_dashboard(clock):
    lines = run(clock, "plain").splitlines()
    assert lines[0].startswith("compiling kernels: ")
    assert "4 tasks (generate 4) on 2 workers; dashboard: http://here:8787/status" in lines
    assert "failed: generate shard 1: [the] disk was full" in lines
    assert "again: generate shard 2: OSError: once" in lines and lines[-1] == "nothing new"
    out = io.StringIO()
    with Board(TASKS, Estimate(), form_of("plain", Console(file=out, width=200))) as board:
        board.start(1, None)
        for task in TASKS:
            board.begin(task)
            clock.now += 20.0
            board.end(task, "why" if task is TASKS[2] else "", seconds=1.0)
    shown = [line for line in out.getvalue().splitlines() if " of " in line]
    assert shown[0] == "generate 2 of 4 tasks; all 2 of 4, 3 tasks/min, 0:00:02 left"
    assert shown[-1] == "generate 4 of 4 tasks; all 4 of 4, 1 failed, 3 tasks/min, 0:00:00 left"


def test_bars_have_failures_rate_and_dashboard_and_are_shown_on_a_terminal_alone(clock):
    text = run(clock, "rich")
    assert "dashboard: http://here:8787/status" in text and "2/4 tasks, 1 failed" in text and "4 tasks/min" in text
    for form, is_terminal in (("rich", True), ("plain", None)):
        console = Console(file=io.StringIO(), force_terminal=is_terminal)
        assert form_of("auto", console).__func__ is form_of(form, console).__func__


def test_silence_is_told_after_a_minute_and_less_and_less_often(clock):
    out = io.StringIO()
    task = fake.task("tweed")
    with Board([task], Estimate(), form_of("plain", Console(file=out, width=200))) as board:
        board.start(2, None)
        board.begin(task)
        said = []
        for clock.now in range(0, 600, 5):
            before = len(out.getvalue())
            board.waiting_for([task])
            if "nothing reported" in out.getvalue()[before:]:
                said.append(clock.now)
        assert said == [60, 120, 240, 480]
        board.hear({"task": task.id, "share": 0.5})
        board.waiting_for([task])
        board.workers = 0
        clock.now += 61
        board.waiting_for([task])
        clock.now += 121
        board.workers = 2
        board.waiting_for([task] * 70)
    assert "generate tweed, generate tweed and 65 more (2 workers)" in out.getvalue()
    assert "under way: generate tweed (2 workers)" in out.getvalue()
    assert out.getvalue().count("no worker: the scheduler has none") == 1
