"""Disks that are full or cannot be written: one sentence, exit code 1 or 2, and nothing computed is lost."""

import shutil
import subprocess

import pytest

from tests.faults.runs import assert_no_leftovers, end, hashes, run, start

pytestmark = pytest.mark.faults

MOUNT = ["unshare", "--mount", "--map-root-user"]


def may_mount():
    probe = [*MOUNT, "sh", "-c", "mount -t tmpfs -o size=64k tmpfs /mnt"]
    return shutil.which("unshare") is not None and subprocess.run(probe, capture_output=True).returncode == 0


@pytest.mark.parametrize("share", [0.02, 0.1, 0.3, 0.5, 0.7, 0.85, 0.95])
def test_a_full_disk_ends_a_run_and_the_next_one_continues(recipe, undisturbed, tmp_path, share):
    """A small tmpfs fills at another stage for each share of what the whole run needs."""
    if not may_mount():
        pytest.skip("this system lets no user mount a tmpfs")
    whole = sum(path.stat().st_blocks * 512 for path in undisturbed[0].rglob("*") if path.is_file())
    small, out = tmp_path / "small", tmp_path / "out"
    small.mkdir()
    script = f"mount -t tmpfs -o size={int(share * whole) // 1024}k tmpfs {small} || exit 99\n"
    script += f'"$@"; code=$?; cp -a {small} {out}; exit $code'
    found = end(start(recipe, small, before=[*MOUNT, "sh", "-c", script, "sh"]))
    assert found.code == 1, found.stderr
    found.assert_sentence()
    assert "No space left" in found.stderr
    kept = set(out.rglob("*.parquet"))
    found = run(recipe, out)
    assert found.code == 0, found.stderr
    assert hashes(recipe, out) == undisturbed[1] and all(path.exists() for path in kept)
    assert_no_leftovers(out)  # a worker that was writing when the run ended may have left some before


def test_an_output_folder_that_cannot_be_written_is_refused(recipe, undisturbed, tmp_path):
    if not may_mount():
        pytest.skip("this system lets no user mount a tmpfs")
    out = tmp_path / "out"
    out.mkdir()
    script = f'mount -t tmpfs -o ro tmpfs {out} || exit 99\n"$@"'
    found = end(start(recipe, out, before=[*MOUNT, "sh", "-c", script, "sh"]))
    assert found.code == 2, found.stderr
    found.assert_sentence()
    assert str(out) in found.stderr
