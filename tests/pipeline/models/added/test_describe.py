import re

import pytest

from pipeline.models.added import describe as describe_module
from pipeline.models.added.apart import run_apart
from pipeline.models.added.describe import describe
from tests.pipeline.models.stand_ins import METHOD, TRAINED
from tests.refusals import refusal
from weaves.errors import BadInput

pytestmark = pytest.mark.usefixtures("described_here")


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "theirs.py"
    path.write_text(METHOD)
    return path


def test_a_file_says_what_it_holds_and_a_class_with_a_network_is_trained(path, monkeypatch):
    """A module of the current folder is its file."""
    found = describe(f"{path}:Theirs", {"rows": 9}, {"limit": 5.0})
    assert (found.name, found.stated, found.setting, found.kinds) == ("theirs", "2.1", "", {"stretch"})
    assert (found.own, found.limit, found.source) == ({"rows": 9}, 5.0, f"{path}:Theirs")
    assert found.origin == f"theirs.py, version 2.1, SHA-256 {found.sha256}"
    sentence = "__init__: AssertionError: too many rows (theirs.py, line 6)"
    assert sentence in refusal(describe, f"{path}:Theirs", {"rows": 500}, {})
    assert not list(path.parent.glob("__pycache__"))
    monkeypatch.chdir(path.parent)
    assert describe("theirs:Theirs", {"rows": 9}, {"limit": 5.0}) == found
    assert not describe(f"{path}:Theirs", {}, {}).learns
    path.write_text(METHOD + TRAINED)
    method = describe(f"{path}:Theirs", {}, {})
    assert method.learns and not method.of_one_material
    path.write_text(METHOD + TRAINED + "    of_one_material = True\n")
    assert describe(f"{path}:Theirs", {}, {}).of_one_material


def test_every_file_of_a_package_counts(tmp_path, monkeypatch):
    package = tmp_path / "their_package"
    package.mkdir()
    (package / "__init__.py").write_text("from their_package.inner import Theirs\n")
    (package / "inner.py").write_text(METHOD)
    (package / "weights.bin").write_bytes(b"1")
    monkeypatch.chdir(tmp_path)
    first = describe("their_package:Theirs", {}, {})
    assert (first.source, first.folder, first.distribution) == ("their_package:Theirs", str(tmp_path), "")
    (package / "weights.bin").write_bytes(b"2")
    assert describe("their_package:Theirs", {}, {}).sha256 != first.sha256


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("class Theirs", "import nothing_of_this_name\nclass Theirs", "ModuleNotFoundError: No module named"),
        ("class Theirs", "class Theirs(", "(theirs.py, line 2)"),
        ("class Theirs", "raise SystemExit\nclass Theirs", "import: SystemExit (theirs.py, line 2)"),
        ("class Theirs", "class Other", "no such name; known: Other"),
        ("class Theirs:", "Theirs = 5\nclass Other:", "is no class of a method and no function of a metric"),
        ("def covers", "def cover", "lacks the function 'covers'"),
        ("def predict", "predict = 5\n    def forecast", "lacks the function 'predict'"),
        ('"2.1", ""', '2.1, ""', "version = 2.1 must be an integer or a short text"),
        ('version, setting, kinds = "theirs", "2.1"', 'setting, kinds = "theirs"', "lacks the attribute 'version'"),
        ('"theirs", "2.1"', '"../theirs", "2.1"', "name = '../theirs' must be letters"),
        ('"2.1", ""', '"2.1", "a | `b`"', "setting = 'a | `b`' must be at most 40 letters, digits, spaces"),
        ('{"stretch"}', '{"sideways"}', "kinds = ['sideways'] must be some of behind, stretch, curvature"),
        ("    def covers", "    network = print\n\n    def covers", "has a function 'network' and lacks 'load'"),
        ("    def covers", "    of_one_material = True\n\n    def covers", "and lacks a function 'network'"),
        ("    def covers", "    of_one_material = 1\n\n    def covers", "of_one_material = 1 must be True or False"),
        ("rows=8", "rows", "its option 'rows' has no default; every option needs one"),
    ],
)
def test_code_that_is_no_method_gets_a_sentence(path, old, new, sentence):
    assert METHOD.count(old) == 1
    path.write_text(METHOD.replace(old, new))
    with pytest.raises(BadInput, match=f"^--add: .*{re.escape(sentence)}"):
        describe(f"{path}:Theirs", {}, {})


def test_code_that_ends_its_process_or_needs_more_memory_than_its_limit_gets_a_sentence(path, monkeypatch):
    monkeypatch.setattr(describe_module, "run_apart", run_apart)
    path.write_text("import os; os._exit(0)" + METHOD)
    assert "import ended its process (exit code 0)" in refusal(describe, f"{path}:Theirs", {}, {})
    path.write_text("x = __import__('numpy').zeros(2**27)\n" + METHOD)
    assert describe(f"{path}:Theirs", {}, {"memory": 2.0}).memory == 2.0
    sentence = "import: it needs more than 0.5 GiB of memory, its limit (theirs.py, line 1)"
    assert sentence in refusal(describe, f"{path}:Theirs", {}, {"memory": 0.5})


METRIC = '''
def largest(fabric, queries, answers, truth, standard_error):
    """Largest error
    of any component.

    More."""
    return abs(answers - truth).max()


largest.unit, largest.version = "1/sr", 2
'''


def test_a_function_is_a_metric_and_a_file_of_gigabytes_is_refused_unread(path):
    path.write_text(METRIC)
    found = describe(f"{path}:largest", {}, {})
    assert (found.name, found.title, found.definition) == ("largest", "largest", "Largest error of any component.")
    assert (found.unit, found.better, found.stated) == ("1/sr", "lower", "2")
    with path.open("r+b") as file:
        file.truncate(3 << 30)
    assert "the file theirs.py has more than 16,777,216 bytes" in refusal(describe, f"{path}:Theirs", {}, {})


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        (", standard_error)", ")", "a metric is a function of fabric, queries, answers, truth, standard_error"),
        ('"""Largest error', '""; """Largest error', "lacks a docstring"),
        ("largest", "Largest", "name = 'Largest'"),
        ('"1/sr", 2', "5, 2", "unit = 5"),
    ],
)
def test_a_function_that_is_no_metric_gets_a_sentence(path, old, new, sentence):
    assert old in METRIC
    path.write_text(METRIC.replace(old, new))
    with pytest.raises(BadInput, match=sentence):
        describe(f"{path}:{'Largest' if new == 'Largest' else 'largest'}", {}, {})
