"""A render that is killed leaves what was there before, and the next one is whole."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.faults

KILLED = """
import os, signal, sys
import reports.images.tiles, jobs.verbs.render as verb
shown, left = reports.images.tiles.displayed, [int(sys.argv[1])]
def displayed(*given):
    if not left[0]:
        os.kill(os.getpid(), signal.SIGKILL)
    left[0] -= 1
    return shown(*given)
verb.displayed = displayed
from jobs.cli import main
sys.exit(main(sys.argv[2:]))
"""
FAST = ("--size", "16x12", "--directions", "4", "--method", "soft_nodes")


def render(folder, after, *tokens):
    """Run the verb in a folder; it is killed once so many frames are rendered. Return its exit code."""
    command = [sys.executable, "-c", KILLED, str(after), "render", "plane", *FAST, *tokens]
    search = os.pathsep.join([str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", "")])
    return subprocess.run(command, cwd=folder, env={**os.environ, "PYTHONPATH": search}, check=False).returncode


def names(folder):
    return sorted(path.name for path in folder.iterdir() if not path.name.startswith(".tmp-"))


@pytest.mark.parametrize(("name", "frames"), [("a.png", ()), ("a.mp4", ("--frames", "2"))])
def test_a_killed_picture_leaves_the_one_before(tmp_path, name, frames):
    if frames:
        pytest.importorskip("av")
    (tmp_path / name).write_bytes(b"before")
    assert render(tmp_path, len(frames) // 2, "--out", name, *frames) == -signal.SIGKILL
    assert names(tmp_path) == [name] and (tmp_path / name).read_bytes() == b"before"
    assert render(tmp_path, 9, "--out", name, *frames) == 0
    assert len((tmp_path / name).read_bytes()) > 100 and list(tmp_path.iterdir()) == [tmp_path / name]


def test_a_killed_folder_holds_whole_frames(tmp_path):
    assert render(tmp_path, 1, "--out", "film", "--frames", "2") == -signal.SIGKILL
    assert names(tmp_path / "film") == ["frame-0001.png"]
    first = (tmp_path / "film" / "frame-0001.png").read_bytes()
    assert render(tmp_path, 9, "--out", "film", "--frames", "2") == 0
    assert names(tmp_path / "film") == ["frame-0001.png", "frame-0002.png"]
    assert (tmp_path / "film" / "frame-0001.png").read_bytes() == first
