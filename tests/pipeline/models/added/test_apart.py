import os
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from pipeline.models.added.apart import run_apart
from pipeline.models.added.guarded import MethodFailed
from weaves.errors import BadInput, WorkFailed

ROOT = Path(__file__).parents[4]

GUARDED = "__import__('pipeline.models.added.guarded', fromlist=['WATCH'])"
BEGIN = f"{GUARDED}.WATCH.begin(b'theirs', b'predict', 0.5)"
END = f"{GUARDED}.WATCH.end(b'theirs', b'predict', 0.5)"


class Code:
    """A function that the other process reads from its text: this module is unknown there."""

    def __init__(self, text):
        self.text = text

    def __reduce__(self):
        return eval, (self.text,)


def test_the_result_and_the_progress_come_back():
    shares = []
    assert run_apart(Code("lambda a, progress: [progress(.5), 2 * a][1]"), 21, progress=shares.append) == 42
    assert shares == [0.5]


def test_it_is_another_process_with_the_paths_of_this_one(tmp_path, monkeypatch):
    (tmp_path / "weaves").mkdir()
    (tmp_path / "weaves" / "__init__.py").write_text("raise RuntimeError('hides a package')")
    monkeypatch.chdir(tmp_path)
    assert run_apart(Code("lambda progress: __import__('os').getpid()")) != os.getpid()


def test_bad_input_comes_back_as_it_is():
    with pytest.raises(BadInput, match=r"^a: b = 1: no$"):
        run_apart(
            Code("lambda p: (_ for _ in ()).throw(__import__('weaves.errors').errors.BadInput('a', 'b', 1, 'no'))")
        )


def test_an_unexpected_exception_has_its_traceback():
    with pytest.raises(RuntimeError, match="ZeroDivisionError"):
        run_apart(Code("lambda progress: 1 / 0"))


def test_a_call_that_hangs_is_ended():
    start = time.monotonic()
    with pytest.raises(MethodFailed, match=r"^theirs: predict took longer than 0.5 s, its limit$"):
        run_apart(Code(f"lambda progress: [{BEGIN}, __import__('time').sleep(600)]"))
    assert time.monotonic() - start < 300


def test_time_between_calls_does_not_count():
    assert run_apart(Code(f"lambda progress: [{BEGIN}, {END}, __import__('time').sleep(1), 7][3]")) == 7


@pytest.mark.parametrize(("death", "how"), [("_exit(3)", "exit code 3"), ("abort()", "signal SIGABRT")])
def test_code_that_ends_the_process_is_named(death, how):
    with pytest.raises(MethodFailed, match=rf"^theirs: predict ended its process \({how}\)$"):
        run_apart(Code(f"lambda progress: [{BEGIN}, __import__('os').{death}]"))


def test_a_process_that_dies_outside_of_calls_blames_no_method():
    with pytest.raises(WorkFailed, match=r"ended \(exit code 9\)") as failure:
        run_apart(Code("lambda progress: __import__('os')._exit(9)"))
    assert not isinstance(failure.value, MethodFailed)


PARENT = """
from pipeline.models.added.apart import run_apart

class Code:
    def __reduce__(self):
        return eval, ("lambda p: (p(__import__('os').getpid()), __import__('time').sleep(3600))",)

run_apart(Code(), progress=lambda pid: print(int(pid), flush=True))
"""


def test_the_process_ends_when_its_parent_is_killed():
    with subprocess.Popen([sys.executable, "-c", PARENT], stdout=subprocess.PIPE, text=True, cwd=ROOT) as parent:
        child = psutil.Process(int(parent.stdout.readline()))
        parent.kill()
        child.wait(timeout=120)
