"""Signals, two runs at the same time, clocks that are off, full disks: one sentence, and the same bytes after."""

import os
import shutil
import signal
import subprocess
import time

import pytest

from tests.faults.runs import cluster, end, family, finish, gone, hashes, leftovers, run, start

pytestmark = pytest.mark.faults

CODES = {"SIGINT": {130, -2, 0}, "SIGTERM": {143, -15, 0}, "SIGHUP": {129, -1, 0}}
"""By signal; negative before the command line is loaded, 0 if the run has ended before."""

YEAR = 365.25 * 86400.0
SHIFT = """
import os, time
_shift, _time, _time_ns = float(os.environ["CLOCK_SHIFT"]), time.time, time.time_ns
time.time = lambda: _time() + _shift
time.time_ns = lambda: _time_ns() + int(_shift * 1e9)
"""

MOUNT = ["unshare", "--mount", "--map-root-user"]


@pytest.mark.parametrize("name", CODES)
def test_a_signal_at_five_moments(recipe, undisturbed, tmp_path, name):
    out = tmp_path / "out"
    for wait in (0.1, 0.7, 2.0, 5.0, 9.0):
        process = start(recipe, out)
        time.sleep(wait)
        children = family(process)
        process.send_signal(getattr(signal, name))
        ended = end(process, timeout=60.0)
        assert ended.code in CODES[name], ended
        assert ended.code <= 0 or ended.sentence.startswith("stopped")
        assert ("Traceback" not in ended.stderr or ended.code < 0) and not gone(children)
    finish(recipe, out, undisturbed)


def test_a_second_run_on_one_folder_is_refused_and_disturbs_nothing(recipe, undisturbed, tmp_path):
    out = tmp_path / "out"
    first = start(recipe, out)
    while not (out / "ledger" / "lock").exists():
        time.sleep(0.01)
    second = run(recipe, out, code=1)
    assert second.sentence and "another run is at work in this folder" in second.stderr
    ended = end(first)
    assert ended.code == 0, ended.stderr
    assert hashes(recipe, out) == undisturbed[1] and not leftovers(out)


def test_two_runs_on_one_scheduler_each_fill_their_folder(recipe, undisturbed, tmp_path):
    with cluster(tmp_path, 0) as (_, file):
        started = {name: start(recipe, tmp_path / name, "--scheduler", str(file)) for name in ("a", "b")}
        ends = {name: end(process) for name, process in started.items()}
    for name, ended in ends.items():
        assert ended.code == 0, ended.stderr
        assert hashes(recipe, tmp_path / name) == undisturbed[1]


@pytest.mark.parametrize("shift", [3600.0, -3600.0, 50.0 * YEAR, -50.0 * YEAR])
def test_a_clock_that_is_off_changes_no_byte_and_makes_nothing_again(recipe, undisturbed, tmp_path, shift):
    """Half of a run with a clock that is off, files dated by it, the rest with the right clock."""
    (tmp_path / "sitecustomize.py").write_text(SHIFT)
    out = tmp_path / "out"
    search = os.pathsep.join(filter(None, [str(tmp_path), os.environ.get("PYTHONPATH", "")]))
    run(recipe, out, verb="generate", env={"PYTHONPATH": search, "CLOCK_SHIFT": str(shift)})
    date = time.time() + shift
    for path in out.rglob("*"):
        os.utime(path, (date, date))
    before = {path: path.stat().st_ino for path in out.glob("datasets/*/*.parquet")}
    finish(recipe, out, undisturbed)
    assert {path: path.stat().st_ino for path in out.glob("datasets/*/*.parquet")} == before


@pytest.fixture
def mounts():
    """Skip a test where no user may mount a tmpfs."""
    probe = [*MOUNT, "sh", "-c", "mount -t tmpfs -o size=64k tmpfs /mnt"]
    if shutil.which("unshare") is None or subprocess.run(probe, capture_output=True).returncode:
        pytest.skip("this system lets no user mount a tmpfs")


@pytest.mark.usefixtures("mounts")
@pytest.mark.parametrize("share", [0.02, 0.1, 0.3, 0.5, 0.7, 0.85, 0.95])
def test_a_full_disk_ends_a_run_and_the_next_one_continues(recipe, undisturbed, tmp_path, share):
    """A small tmpfs fills at another stage for each share of what the whole run needs; nothing computed is lost."""
    whole = sum(path.stat().st_blocks * 512 for path in undisturbed[0].rglob("*") if path.is_file())
    small, out = tmp_path / "small", tmp_path / "out"
    small.mkdir()
    script = f"mount -t tmpfs -o size={int(share * whole) // 1024}k tmpfs {small} || exit 99\n"
    script += f'"$@"; code=$?; cp -a {small} {out}; exit $code'
    ended = run(recipe, small, before=[*MOUNT, "sh", "-c", script, "sh"], code=1)
    assert ended.sentence and "No space left" in ended.stderr
    kept = set(out.rglob("*.parquet"))
    finish(recipe, out, undisturbed)
    assert all(path.exists() for path in kept)


@pytest.mark.usefixtures("mounts")
def test_an_output_folder_that_cannot_be_written_is_refused(recipe, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    script = f'mount -t tmpfs -o ro tmpfs {out} || exit 99\n"$@"'
    ended = run(recipe, out, before=[*MOUNT, "sh", "-c", script, "sh"], code=2)
    assert ended.sentence and str(out) in ended.stderr
