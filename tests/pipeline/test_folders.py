import json
import subprocess
import sys

import pytest

from pipeline.folders import own_files
from tests.refusals import refusal
from weaves.errors import BadInput, WorkFailed

LISTING = "list.json"


def write(folder, **texts):
    """Write files, `__` in a name for a folder."""
    with own_files(folder, LISTING) as new:
        for name, text in texts.items():
            (path := new / name.replace("__", "/")).parent.mkdir(exist_ok=True)
            path.write_text(text)


def content(folder):
    return {path.relative_to(folder).as_posix(): path.read_text() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture
def folder(tmp_path):
    """Return a folder with files of an earlier run, a repository and a note."""
    folder = tmp_path / "folder"
    (folder / ".git").mkdir(parents=True)
    (folder / ".git" / "config").write_text("core")
    write(folder, a="1", b="1", deep__c="1")
    (folder / "deep" / "note").write_text("mine")
    return folder


def test_own_files_are_replaced_or_removed_others_stay_and_a_listing_may_have_its_content(folder, tmp_path):
    write(folder, a="2", new__d="2")
    left = content(folder)
    assert set(json.loads(left.pop(LISTING))["files"]) == {"a", "new/d", LISTING}
    assert left == {"a": "2", "new/d": "2", "deep/note": "mine", ".git/config": "core"}
    (folder / "deep" / "note").unlink()
    write(folder, a="3")
    assert not (folder / "new").exists() and (folder / "deep").is_dir(), "only folders that are left empty go"
    for size in (1, 2):
        with own_files(tmp_path, LISTING) as new:
            (new / LISTING).write_text(f'{{"size": {size}.0}}')
    assert json.loads((tmp_path / LISTING).read_text())["size"] == 2.0


def rewritten(path, old, new):
    path.write_text(path.read_text().replace(old, new, 1))


def replaced_by_link(path, target):
    path.unlink(missing_ok=True)
    path.symlink_to(target)


DAMAGE = {
    "a": lambda path: path.write_text("mine"),
    "a, a link": lambda path: replaced_by_link(path, path.parent / "b"),
    "a, a folder": lambda path: (path.unlink(), path.mkdir()),
    "d": lambda path: path.write_text("mine"),
    "new": lambda path: replaced_by_link(path, path.parent / ".git"),
    LISTING: lambda path: rewritten(path, "{", '{"note": 1, '),
    f"{LISTING}, none": lambda path: path.write_text("mine"),
    f"{LISTING}, escaping": lambda path: rewritten(path, '"a"', '"../a"'),
}
"""Changes of a folder after which nothing may be written there, by the path that is named."""


@pytest.mark.parametrize("case", DAMAGE)
def test_what_is_not_its_own_is_refused_by_name_before_anything_is_touched(folder, case):
    path = folder / case.partition(",")[0]
    DAMAGE[case](path)
    before = content(folder)
    with pytest.raises(BadInput) as refused:
        write(folder, a="2", d="2", new__d="2")
    assert path.name in str(refused.value) and "\n" not in str(refused.value)
    assert content(folder) == before


def test_an_error_leaves_the_files_of_before_and_two_processes_do_not_write_one_folder(folder):
    before = content(folder)
    with pytest.raises(WorkFailed), own_files(folder, LISTING) as new:
        (new / "a").write_text("half")
        raise OSError(28, "No space left on device")
    assert content(folder) == before
    with pytest.raises(RuntimeError), own_files(folder.parent / "none", LISTING):
        raise RuntimeError
    assert not (folder.parent / "none").exists()
    with own_files(folder, LISTING), pytest.raises(WorkFailed, match="another process"):
        write(folder, a="2")


KILLED = """
import os, sys
from pathlib import Path
from pipeline.folders import own_files

def replace(self, target, moved=[], replace=Path.replace):
    moved.append(target)
    if len(moved) > int(sys.argv[2]):
        os._exit(9)
    return replace(self, target)

Path.replace = replace
with own_files(Path(sys.argv[1]), "list.json") as new:
    for name in "axyz":
        (new / name).write_text("killed")
"""


def killed(folder, moves):
    done = subprocess.run([sys.executable, "-c", KILLED, str(folder), str(moves)], check=False)
    assert done.returncode == 9


@pytest.mark.parametrize("moves", [0, 1, 3, 5], ids=["no_journal", "journal", "two_files", "no_listing"])
def test_a_run_after_a_kill_knows_the_files_of_both(folder, moves):
    killed(folder, moves)
    write(folder, b="2")
    left = content(folder)
    del left[LISTING]
    assert left == {"b": "2", "deep/note": "mine", ".git/config": "core"}


def test_after_a_kill_a_changed_file_is_refused_too(folder):
    killed(folder, 3)
    assert (folder / "a").read_text() == (folder / "x").read_text() == "killed"
    (folder / "x").write_text("mine")
    before = content(folder)
    assert "x: was changed" in refusal(write, folder, b="2")
    assert content(folder) == before
