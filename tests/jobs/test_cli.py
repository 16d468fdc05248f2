import shlex
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

import jobs.verbs.run
import jobs.verbs.show
from jobs.cli import VERBS, app
from jobs.recipe.load import load_recipe
from pipeline.truth import invariants
from pipeline.truth.invariants import exact, worst
from reports.images.exr import read_exr
from weaves.errors import BadInput, WorkFailed
from weaves.fabric import load_fabric
from weaves.surface import surface_at

ROOT = Path(__file__).parents[2]


def test_help_lists_the_verbs_in_the_order_of_work_and_the_version_is_that_of_the_package(twillight):
    code, text, _ = twillight("--help")
    verbs = [line.split()[1] for line in text.splitlines() if line.startswith("│") and line.split()[1].isalpha()]
    order = ["list", "import", "show", "export", "render", "plan", "generate", "evaluate", "check", "train", "bench"]
    order += ["report", "run", "status", "compare"]
    assert code == 0 and [verb for verb in verbs if verb in order] == order
    assert twillight("--version")[:2] == (0, f"twillight {version('twillight')}\n")


def test_every_help_ends_with_examples_that_are_understood(twillight):
    for verb, about in VERBS.items():
        code, text, _ = twillight(*verb.split(), "--help")
        # Lines break at the width of the first help that the process showed.
        shown, calls = text.partition("Examples:")[2].split(), [f"twillight {verb} {own}" for own in about["examples"]]
        assert code == 0 and shown == " ".join(calls).split()
        for call in calls:
            app.parse_args(shlex.split(call)[1:], exit_on_error=False, print_error=False)


def test_list_plan_and_status_compute_nothing_and_pictures_of_show_agree_with_the_geometry(twillight, tmp_path):
    code, text, _ = twillight("list")
    known = [load_fabric("tartan"), load_recipe("quick")]
    assert code == 0 and all(words in text for words in (known[0].weave.name, known[0].source, known[1].about))
    code, text, _ = twillight("show", "denim")
    assert code == 0 and "· ██████" in text and "roughness" in text and "about" in twillight("plan", "smoke")[1]
    code, text, _ = twillight("status", "smoke")
    assert code == 0 and "generate     0       0       14" in text and not list(tmp_path.iterdir())
    code, text, _ = twillight("show", "denim", "--out", "shown", "--maps", "--size", "32x24")
    kinds = ("draft.png", "height.png", "normals.png", "maps.exr", "swatch.png")
    names = [f"denim-{kind}" for kind in kinds]
    assert code == 0 and all(name in text for name in names)
    assert sorted(path.name for path in (tmp_path / "shown").iterdir()) == sorted(names)
    maps = read_exr(tmp_path / "shown" / "denim-maps.exr")
    geometry = surface_at(load_fabric("denim"), np.array([1.5 / 64]), np.array([2.5 / 64]))
    assert maps.channels["height"][-3, 1] == pytest.approx(geometry.height[0], abs=1e-6)
    assert maps.stack("normal.X", "normal.Y", "normal.Z")[-3, 1] == pytest.approx(geometry.normal[0], abs=1e-6)


def _caused(error, by):
    error.__cause__ = by
    return error


@pytest.mark.parametrize(
    ("error", "code", "words"),
    [
        (KeyboardInterrupt(), 130, "the same command continues"),
        (WorkFailed("the loss diverged"), 1, "the loss diverged"),
        (ZeroDivisionError("by zero"), 1, "this is a bug in twillight"),
        (_caused(RuntimeError("in a library"), by=KeyboardInterrupt()), 130, "the same command continues"),
        (_caused(RuntimeError("in a library"), by=BadInput("scene", "uv", "", "uv are needed")), 2, "uv are"),
    ],
)
def test_every_end_is_one_sentence(twillight, tmp_path, monkeypatch, error, code, words):
    monkeypatch.setattr(jobs.verbs.run, "work", Mock(side_effect=error))
    (tmp_path / "products").mkdir()
    ended, _, told = twillight("run", "quick", "--out", "products")
    assert ended == code and words in told and told.count("\n") == 1 and "Traceback" not in told
    crashes = list((tmp_path / "products").glob("crash-*.txt"))
    assert len(crashes) == isinstance(error, ZeroDivisionError)
    for crash in crashes:
        assert "twillight run quick" in crash.read_text() and "Traceback" in crash.read_text()


def test_check_of_a_fabric_shows_its_invariants_and_fails_if_one_is_broken(twillight, tmp_path, monkeypatch):
    def holds(fabric):
        return [exact("as it should be", 1.0, 1.0, 0.0), worst("close", 1.01, 1.0, 0.01, 15)]

    def breaks(fabric):
        return [exact(f"made of {fabric.name}", 2.0, 1.0, 0.0), worst("far off", 2.0, 1.0, 0.01, 15)]

    monkeypatch.setattr(invariants, "INVARIANTS", (holds,))
    (tmp_path / "own.toml").write_text(load_fabric("denim").model_copy(update={"name": "own"}).to_toml())
    for fabric in ("denim", "own.toml"):
        code, text, told = twillight("check", fabric)
        assert (code, told) == (0, "") and text.startswith(fabric.removesuffix(".toml"))
        assert "exactly" in text and "within statistics (+1.0 σ)" in text
    monkeypatch.setattr(invariants, "INVARIANTS", (holds, breaks))
    code, text, told = twillight("check", "denim")
    assert code == 1 and text.count("NO") == 2
    assert told == "denim: 2 of 4 invariants do not hold: made of denim, far off\n"


@pytest.mark.parametrize(
    ("redirected", "expected", "sentence"),
    [
        ("> /dev/full", 1, "stdout: No space left on device; what was to be printed is lost\n"),
        (">&-", 2, "stdout is closed; send it to a file or to /dev/null\n"),
        ("| true", 0, ""),
        ("> /dev/full 2>&1", 1, ""),
    ],
)
def test_an_output_that_takes_nothing_is_one_sentence(redirected, expected, sentence):
    command = f"set -o pipefail; {sys.executable} -m jobs.cli list {redirected}"
    done = subprocess.run(["bash", "-c", command], cwd=ROOT, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (expected, sentence)
