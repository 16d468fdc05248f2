"""Methods and a network from outside, entered as docs/own_method.md says, from the text alone; then faults."""

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from reports.record import read_records

pytestmark = pytest.mark.external  # a cluster of dask

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "own_method.md").read_text(encoding="utf-8")
(METRIC,) = re.findall(r"^`largest_error.py`:\n\n```python\n(.*?)^```$", TEXT, re.M | re.S)
SECTION = TEXT.partition("# A method of your own\n")[2].partition("\n## ")[0]
NETWORK = TEXT.partition("\n## A network of your own\n")[2].partition("\n## ")[0]

LATE = """
import numpy as np


class Late:
    name, version, setting = "late", 1, ""

    def covers(self, fabric):
        return True

    def prepare(self, fabric):
        if "edit" in fabric.name:
            raise KeyError("a fabric that was edited")

    def predict(self, fabric, queries, seed=0):
        return np.ones((len(queries.u), 4), np.float32)

    def bytes_stored(self, fabric):
        return 0
"""

HANGS = (
    LATE.replace("Late", "Hangs")
    .replace('"late"', '"hangs"')
    .replace("return np.ones", "import time; time.sleep(600)\n        return np.ones")
)

SCENE = """
[bench.scenes]
names = ["plane"]
size = [16, 16]
frames = 3
options = { environment_directions = 4 }
truth = { relative_error = 0.2, min_count = 64, max_count = 64 }
frame_truth = { relative_error = 0.2, min_count = 64, max_count = 64 }
image = { block = 4, resamples = 100 }
"""


def run(command, folder):
    """Run a line of the text in a folder, as a user with the package installed would."""
    program, *arguments = shlex.split(command)
    assert program == "twillight"
    env = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONSAFEPATH": "1"}
    command = [sys.executable, "-m", "jobs.cli", *arguments]
    return subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True)


def files_and_command(section):
    """Return the files of a section of the text by their names, and its command."""
    (command,) = re.findall(r"^```sh\n(.*)\n```$", section, re.M)
    return dict(re.findall(r"^`(\S+)`:\n\n```\w+\n(.*?)^```$", section, re.M | re.S)), command


FILES, COMMAND = files_and_command(SECTION)


def followed(section, folder):
    """Write the files of a section of the text into a folder, and run its command; return the folder."""
    files, command = files_and_command(section)
    for name, content in files.items():
        (folder / name).write_text(content, encoding="utf-8")
    done = run(command, folder)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope="module")
def entered(tmp_path_factory):
    return followed(SECTION, tmp_path_factory.mktemp("entered"))


def test_the_text_is_enough(entered):
    assert {path.name for path in entered.iterdir()} == {"nearest_table.py", "mine.toml", "out"} == {*FILES, "out"}
    page = entered / "out" / "report" / "mine"
    html = (page / "index.html").read_text(encoding="utf-8")
    records = [one for one in read_records([page / "records.json"]) if one.method == "nearest_table"]
    assert {one.metric for one in records} >= {"mse", "flicker", "time", "prepare_time", "size_colour", "extreme_error"}
    (origin,) = {one.provenance.origin for one in records}
    assert re.fullmatch(r"nearest_table\.py, version 1, SHA-256 [0-9a-f]{64}", origin) and origin in html
    assert len(re.findall(r"<tr[^>]*>\s*<t[hd][^>]*>(?:<[^>]*>|\s)*nearest[ _]table", html)) > 3, "a row in each table"
    assert "nothing to do" in run(COMMAND, entered).stdout
    without = run(COMMAND.partition(" --add")[0], entered)
    assert without.returncode == 2 and "'nearest_table'" in without.stderr and "--add FILE.py:CLASS" in without.stderr


@pytest.fixture(scope="module")
def learnt(tmp_path_factory):
    return followed(NETWORK, tmp_path_factory.mktemp("learnt"))


@pytest.mark.slow
def test_the_text_is_enough_for_a_network(learnt):
    page = learnt / "out" / "report" / "learnt"
    html = (page / "index.html").read_text(encoding="utf-8")
    records = [one for one in read_records([page / "records.json"]) if one.method == "perceptron"]
    assert {one.metric for one in records} >= {"mse", "flicker", "time", "bytes_stored", "size_colour", "extreme_error"}
    assert {one.provenance.seed for one in records if one.metric == "mse"} == {0, 1}
    (origin,) = {one.provenance.origin for one in records}
    assert origin in html and "each fabric by itself, 200 steps of 128 queries, 2 trainings" in html
    cards = [json.loads(path.read_text()) for path in (learnt / "out" / "models").glob("*/card.json")]
    assert sorted(card["training"]["seed"] for card in cards) == [0, 1]
    for card in cards:
        assert card["options"]["sha256"] in origin and card["curve"][-1]["loss"] < card["curve"][0]["loss"]
    assert "nothing to do" in run(files_and_command(NETWORK)[1], learnt).stdout


@pytest.mark.slow
def test_a_network_that_fails_leaves_the_others_their_trainings(learnt):
    """One hangs in its loss, one raises; each is one sentence, and the sound network has what it had."""
    text = (learnt / "perceptron.py").read_text(encoding="utf-8")
    loss = "        return (self(batch) - batch.target)"
    assert loss in text
    for name, fault in (("hangs", "__import__('time').sleep(600)"), ("raises", "raise OSError('full')")):
        changed = text.replace(loss, f"        {fault}\n{loss}").replace('"perceptron"', f'"{name}"')
        (learnt / f"{name}.py").write_text(changed, encoding="utf-8")
    recipe = (learnt / "learnt.toml").read_text(encoding="utf-8")
    more = '\n[[models]]\nmodel = "hangs"\nlimit = 5\n\n[[models]]\nmodel = "raises"\nname = "broken"\n'
    (learnt / "more.toml").write_text(recipe.replace('"learnt"', '"more"') + more, encoding="utf-8")
    adds = " ".join(f"--add {name}.py:Perceptron" for name in ("perceptron", "hangs", "raises"))
    done = run(f"twillight train more.toml {adds}", learnt)
    assert done.returncode == 1 and "Traceback" not in done.stderr
    failed = failures(learnt)
    assert failed.keys() == {"hangs on denim", "broken on denim"}
    assert "hangs: loss took longer than 5 s, its limit" in failed["hangs on denim"]
    line = 1 + text[: text.index(loss)].count("\n")
    assert f"broken: loss: OSError: full (raises.py, line {line})" in failed["broken on denim"]
    assert len(list((learnt / "out" / "models").glob("perceptron-*/model.safetensors"))) == 2


def failures(folder):
    notes = [json.loads(path.read_text()) for path in (folder / "out" / "ledger").glob("*.failed.json")]
    return {note["title"]: str(note) for note in notes}


@pytest.mark.slow
def test_methods_that_fail_leave_the_others_their_results(entered):
    """One fails in a measurement of times alone, one in every call, and one is no code."""
    (entered / "late.py").write_text(LATE)
    (entered / "hangs.py").write_text(HANGS)
    (entered / "failing.py").write_text("from nowhere import NOTHING\n")
    assert run(f"{COMMAND} --add failing.py:Nothing", entered).returncode == 2
    recipe = FILES["mine.toml"] + SCENE + '\n[[models]]\nmodel = "hangs"\nlimit = 5\n'
    (entered / "mine.toml").write_text(recipe, encoding="utf-8")
    (entered / "largest_error.py").write_text(METRIC)
    adds = "--add late.py:Late --add hangs.py:Hangs --add largest_error.py:largest_error"
    done = run(f"{COMMAND} {adds}", entered)
    assert done.returncode == 1
    last = done.stderr.splitlines()[-1]
    assert "hangs: predict took longer than 5 s, its limit" in last and "--add late.py:Late" in last
    records = [path for path in (entered / "out" / "records").glob("*.json") if "machine" not in path.name]
    timing = {path.name: read_records([path]) for path in records if "tim" in path.name}
    frame = next(found for name, found in timing.items() if "plane" in name)
    times = next(found for name, found in timing.items() if "plane" not in name and "late" in {r.method for r in found})
    assert {one.method for one in times if one.metric == "time"} == {"truth", "point_sampled", "nearest_table"}
    assert {one.method for one in frame if one.metric == "frame_time"} == {"point_sampled", "nearest_table", "late"}
    notes = {one.method: one.note for one in times if one.metric == "not_run"}
    assert notes["hangs"] == "predict took longer than 5 s, its limit"
    assert notes["late"] == "prepare: KeyError: 'a fabric that was edited' (late.py, line 13)"
    metrics = [path for path in records if path.name.startswith("added-metric-largest_error-")]
    measured = {one.method: one for one in read_records(metrics)}
    assert measured.keys() == {"point_sampled", "nearest_table", "late"}
    assert all(one.unit == "1/sr" and one.value > 0 for one in measured.values())
    failed = {"errors of hangs, denim", "extremes of hangs", "scene errors of hangs, plane"}
    assert failures(entered).keys() == failed | {"added metric of largest_error, hangs, denim"}
