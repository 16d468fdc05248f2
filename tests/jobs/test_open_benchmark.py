"""A method, a metric and a network from outside, entered as docs/own_method.md says, from the text alone."""

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
    (entered / "largest_error.py").write_text(METRIC)
    assert run(f"{COMMAND} --add largest_error.py:largest_error", entered).returncode == 0
    files = (entered / "out" / "records").glob("added-metric-largest_error-*.json")
    measured = read_records([path for path in files if "machine" not in path.name])
    assert {(one.method, one.unit) for one in measured} == {("point_sampled", "1/sr"), ("nearest_table", "1/sr")}
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
