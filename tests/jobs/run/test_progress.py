import io

import pytest
from rich.console import Console

from jobs.plan.estimate import Estimate
from jobs.run import progress
from jobs.run.progress import Board
from jobs.run.progress_forms import form_of


@pytest.fixture
def fake(monkeypatch, request):
    monkeypatch.syspath_prepend(request.path.parents[1])
    import fake_stages

    return fake_stages


def test_silence_is_told_after_a_minute_and_less_and_less_often(fake, monkeypatch):
    now = 0.0
    monkeypatch.setattr(progress.time, "monotonic", lambda: now)
    out = io.StringIO()
    task = fake.task("tweed")
    with Board([task], Estimate(), form_of("plain", Console(file=out, width=200))) as board:
        board.start(2, None)
        board.begin(task)
        said = []
        for now in range(0, 600, 5):
            before = len(out.getvalue())
            board.waiting_for([task], workers=2)
            if "nothing reported" in out.getvalue()[before:]:
                said.append(now)
        assert said == [60, 120, 240, 480]
        board.hear({"task": task.id, "share": 0.5})
        board.waiting_for([task], workers=0)
        now += 61
        board.waiting_for([task], workers=0)
        now += 121
        board.waiting_for([task] * 70, workers=2)
    assert "generate tweed, generate tweed and 65 more (2 workers)" in out.getvalue()
    assert "under way: generate tweed (2 workers)" in out.getvalue()
    assert out.getvalue().count("no worker: the scheduler has none") == 1
