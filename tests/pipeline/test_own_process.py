import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import psutil
import pytest

from pipeline.own_process import ProcessEnded, in_own_process
from tests.faults.runs import gone
from tests.pipeline.sent_code import Code
from weaves.errors import BadInput

ROOT = Path(__file__).parents[2]


def test_the_result_and_the_progress_come_back_from_a_process_with_the_paths_of_this_one(tmp_path, monkeypatch):
    (tmp_path / "weaves").mkdir()
    (tmp_path / "weaves" / "__init__.py").write_text("raise RuntimeError('hides a package')")
    monkeypatch.chdir(tmp_path)
    shares = []
    assert in_own_process(Code("lambda a, progress: [progress(.5), 2 * a][1]"), 21, progress=shares.append) == 42
    assert shares == [0.5]


def test_each_thread_has_a_process_of_its_own_with_one_thread(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    code = Code("lambda progress: (__import__('os').getpid(), __import__('os').environ['OMP_NUM_THREADS'])")
    with ThreadPoolExecutor(2) as pool:
        first, second = [future.result() for future in [pool.submit(in_own_process, code) for _ in range(2)]]
    assert len({first[0], second[0], os.getpid()}) == 3 and first[1] == second[1] == "1"


BAD = "lambda p: (_ for _ in ()).throw(__import__('weaves.errors').errors.BadInput('a', 'b', 1, 'no'))"


@pytest.mark.parametrize(
    ("text", "error", "words"),
    [
        (BAD, BadInput, r"^a: b = 1: no$"),
        ("lambda progress: 1 / 0", ZeroDivisionError, "division"),
        ("lambda p: __import__('sys').exit(3)", RuntimeError, "SystemExit"),
        ("lambda p: open(p)", TypeError, "expected"),
        ("undefined", NameError, "undefined"),
        ("lambda p: __import__('os').abort()", ProcessEnded, r"ended \(signal SIGABRT\); is there enough memory"),
    ],
)
def test_what_is_raised_comes_back_or_is_named(text, error, words):
    with pytest.raises(error, match=words) as failure:
        in_own_process(Code(text))
    assert error is not ZeroDivisionError or "<lambda>" in failure.value.__notes__[0]


PARENT = """
from pipeline.own_process import in_own_process

class Code:
    def __reduce__(self):
        return eval, ("lambda p: (p(__import__('os').getpid()), p(SLEEPER), __import__('time').sleep(3600))",)

in_own_process(Code(), progress=lambda pid: print(int(pid), flush=True))
"""


def test_the_process_ends_when_its_parent_is_killed():
    command = [sys.executable, "-c", PARENT.replace("SLEEPER", SLEEPERS[2])]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT) as parent:
        processes = [psutil.Process(int(parent.stdout.readline())) for _ in range(2)]
        parent.kill()
        assert not gone(processes, 120)


SLEEPERS = [
    "__import__('subprocess').Popen(['sleep', '3600'], close_fds=False).pid",
    "__import__('subprocess').Popen(['sleep', '3600'], start_new_session=True).pid",
    "int(__import__('subprocess').check_output(['sh', '-c', 'setsid sleep 3600 >/dev/null & echo $!']))",
]
"""Start a process that holds the pipe, one in a session of its own, and one whose parent is gone; return its number."""


def ended(pid):
    return not psutil.pid_exists(pid) or not gone([psutil.Process(pid)])


@pytest.mark.parametrize("sleeper", SLEEPERS, ids=["child", "session", "orphan"])
def test_processes_that_it_starts_end_with_it_and_do_not_hide_its_end(sleeper):
    assert ended(in_own_process(Code(f"lambda p: {sleeper}")))
    started = []
    with pytest.raises(ProcessEnded, match="exit code 3"):
        in_own_process(Code(f"lambda p: (p({sleeper}), __import__('os')._exit(3))"), progress=started.append)
    assert ended(int(started[0]))

    def look():
        if len(started) > 1:
            raise ValueError("it takes too long")

    with pytest.raises(ValueError, match="too long"):
        in_own_process(
            Code(f"lambda p: (p({sleeper}), __import__('time').sleep(3600))"), progress=started.append, look=look
        )
    assert ended(int(started[1]))
