"""The door: `twillight` from Python, as its docstrings, the README and a stranger's folders use it."""

import doctest
import inspect
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import fsspec
import matplotlib.pyplot as plt
import numpy as np
import pytest
import torch

import twillight
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.query import Answers
from tests.datasets import write_dataset
from tests.refusals import refusal
from twillight import BadInput, Dataset, Queries, evaluate, load_fabric, load_model, open_dataset

ROOT = Path(__file__).parents[1]
ROWS = {("denim", "train"): (200, 150), ("denim", "test"): (40,), ("twill_4_4", "test"): (30,)}
"""Rows of the shards of each fabric and split."""


@pytest.fixture
def dataset(tmp_path, monkeypatch):
    """A data set where the docstrings expect one; the components of row n of a fabric are n + 1."""
    parts = []
    for (name, split), counts in ROWS.items():
        for start, rows in zip(np.cumsum([0, *counts]).tolist(), counts, strict=False):
            queries = draw_queries(QueryOptions(), load_fabric(name).weave.repeat, len(name), start, rows)
            mean = np.repeat(np.arange(start, start + rows, dtype=np.float32)[:, None] + 1, 4, axis=1)
            parts.append((name, split, start, queries, Answers.opaque(mean, mean, np.ones(rows, np.int32))))
    folder = tmp_path / "out" / "datasets" / "tiny"
    write_dataset(folder, {"seen": ["denim"], "population": [], "unseen": ["twill_4_4"]}, parts)
    monkeypatch.chdir(tmp_path)
    return open_dataset(folder)


def public():
    """Yield the functions and classes of the door with their public methods."""
    for name in twillight.__all__:
        thing = getattr(twillight, name)
        if inspect.isfunction(thing) or (inspect.isclass(thing) and thing is not BadInput):
            yield name, thing
    for name, method in vars(Dataset).items():
        if inspect.isfunction(method) and not name.startswith("_"):
            yield f"Dataset.{name}", method


@pytest.mark.parametrize(("name", "thing"), [("twillight", twillight), *public()])
def test_every_docstring_has_an_example_that_runs(name, thing, dataset):
    names = {name: getattr(twillight, name) for name in twillight.__all__}
    (example, *_) = doctest.DocTestFinder(recurse=False).find(thing, name, module=False, globs=names)
    assert example.examples, f"{name} has no example"
    found = []
    doctest.DocTestRunner().run(example, out=found.append)
    assert not found, "".join(found)


def test_the_example_of_the_readme(tmp_path, monkeypatch):
    """Ten lines as they are printed: the model is within a tenth of the truth, and there is a picture."""
    (example,) = re.findall(r"(?:^    .*\n)*^    from twillight import .*\n(?:^    .*\n)*", README, re.M)
    lines = [line.removeprefix("    ") for line in example.rstrip().splitlines()]
    assert len([line for line in lines if line]) <= 10
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(compile("\n".join(lines), "README.md", "exec"), names)
    plt.close("all")
    (picture,) = tmp_path.iterdir()
    pixels = plt.imread(picture)[..., :3]
    assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > 1000
    truth, model = names["truth"] @ np.ones(4), names["model"] @ np.ones(4)
    assert np.sqrt(np.mean((model - truth) ** 2)) < 0.1 * truth.mean()


README = (ROOT / "README.md").read_text(encoding="utf-8")


def run(code, folder, *paths):
    """Run Python in a folder, whose own packages come first; return its exit code and what it printed."""
    path = os.pathsep.join(map(str, (*paths, ROOT)))
    environment = {**os.environ, "PYTHONPATH": path}
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, env=environment, capture_output=True, text=True)
    return done.returncode, done.stdout + done.stderr


@pytest.mark.external
def test_the_wheel_has_every_file_but_documents_and_opens_in_an_empty_environment(tmp_path):
    """Its libraries are those of this environment; the package is not."""
    source, empty = tmp_path / "source", tmp_path / "empty"
    rooms = ("weaves", "pipeline", "reports", "jobs")
    for name in (*rooms, "twillight.py", "twillight_mitsuba.py", "pyproject.toml", "README.md", "LICENSE"):
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        source.mkdir(exist_ok=True)
        copy(ROOT / name, source / name)
    for cache in source.rglob("__pycache__"):
        shutil.rmtree(cache)
    files = {str(path.relative_to(source)) for room in rooms for path in (source / room).rglob("*") if path.is_file()}
    build = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation", "-w", tmp_path, source]
    subprocess.run(build, check=True)
    (wheel,) = tmp_path.glob("twillight-*-py3-none-any.whl")
    lacks = {name for name in files - set(zipfile.ZipFile(wheel).namelist()) if "reports/entries/" not in name}
    assert {Path(name).suffix for name in lacks} == {".md", ".jpg", ".wif"}, lacks
    subprocess.run([sys.executable, "-m", "venv", empty], check=True)
    subprocess.run([empty / "bin" / "pip", "install", "-q", "--no-deps", wheel], check=True)
    environment = {**os.environ, "PYTHONPATH": sysconfig.get_path("purelib")}  # without its .pth files
    for call in (["twillight", "show", "denim"], ["twillight", "plan", "smoke"], ["python", "-c", OPENED]):
        command = [empty / "bin" / call[0], *call[1:]]
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    assert str(empty) in done.stdout and "selvage" in done.stdout


OPENED = "import twillight, twillight_mitsuba; print(twillight.__file__, twillight.load_model('selvage').name)"


@pytest.mark.parametrize("file", ["weaves/__init__.py", "jobs.py"])
def test_what_hides_a_package_of_ours_is_named_with_both_paths_and_a_folder_without_code_hides_none(file, tmp_path):
    path, name = tmp_path / file, Path(file).parts[0].removesuffix(".py")
    path.parent.mkdir(exist_ok=True)
    assert run("import twillight", tmp_path) == (0, "")
    path.touch()
    code, said = run("import twillight", tmp_path)
    last = said.strip().splitlines()[-1]
    assert code == 1 and last.startswith("ImportError: ")
    assert str(tmp_path / name) in last and str(ROOT / name) in last


def test_evaluate_takes_lists_and_double_precision():
    columns = {"u": [0.5, 1.5], "v": [0.5, 0.5], "sigma": [0.3, 0.3], "wi": [[0.6, 0, 0.8]] * 2, "wo": [[0, 0, 1]] * 2}
    single = Queries.round(**columns)
    assert {column.dtype for column in single} == {np.dtype(np.float32)}
    double = Queries(*(np.asarray(column, np.float64) for column in single))
    denim = load_fabric("denim")
    assert np.array_equal(evaluate(denim, single).mean, evaluate(denim, double).mean)


@pytest.mark.parametrize(
    ("change", "options", "sentence"),
    [
        ({}, {"relative_eror": 0.1}, "relative_eror"),
        ({}, {"relative_error": -1.0}, "relative_error"),
        ({}, {"seed": -1}, "seed = -1"),
        ({"sigma": np.zeros(1, np.float32)}, {}, "sigma[0]"),
        ({"wi": np.float32([[1, 1, 1]])}, {}, "unit length"),
        ({"wi": np.float32([0, 0, 1])}, {}, "shape of wi = (3,)"),
        ({"v": np.zeros(2, np.float32)}, {}, "shape of v = (2,)"),
    ],
)
def test_bad_input_of_evaluate_is_one_sentence(change, options, sentence):
    queries = Queries.round(u=[0.5], v=[0.5], sigma=[0.3], wi=[[0, 0, 1]], wo=[[0, 0, 1]])._replace(**change)
    assert sentence in refusal(evaluate, load_fabric("denim"), queries, **options)


def test_rows_of_a_split_are_the_same_in_every_form(dataset):
    queries, answers = dataset.numpy("denim", "train")
    assert answers.mean[:, 0].tolist() == list(range(1, 351))
    frame = dataset.pandas("train")
    assert frame["diffuse_weft"].tolist() == list(range(1, 351))
    assert np.array_equal(frame[["wi_x", "wi_y", "wi_z"]].to_numpy(), queries.wi)
    batches = list(dataset.torch("train", rows=64, seed=None))
    assert [len(batch["u"]) for batch in batches] == [64, 64, 64, 8, 64, 64, 22]
    assert torch.cat([batch["specular_warp"] for batch in batches]).tolist() == list(range(1, 351))
    frame = dataset.pandas("test")
    assert frame["fabric"].value_counts().to_dict() == {"denim": 40, "twill_4_4": 30}
    assert set(frame[frame["fabric"] == "twill_4_4"]["specular_warp"]) == set(range(1, 31))
    (batch,) = dataset.torch("test", fabrics=["twill_4_4"])
    assert batch["fabric"].tolist() == [0] * 30


def test_rows_are_read_from_object_storage(dataset, tmp_path):
    remote = fsspec.filesystem("memory")
    remote.put(str(tmp_path / "out" / "datasets" / "tiny"), "/bucket/tiny", recursive=True)
    there = open_dataset("memory://bucket/tiny")
    assert there.pandas("train").equals(dataset.pandas("train")) and len(list(there.torch("train", rows=200))) == 2


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda data: data.numpy("denin", "test"), "did you mean 'denim'"),
        (lambda data: data.numpy("twill_4_4", "train"), "twill_4_4 has no such rows"),
        (lambda data: data.pandas("trian"), "did you mean 'train'"),
        (lambda data: data.pandas("validation"), "no fabric has such rows"),
        (lambda data: data.torch("test", rows=0), "rows = 0"),
        (lambda data: data.torch("test", seed=-1), "seed = -1"),
        (lambda data: open_dataset("nowhere"), "does not exist"),
        *((lambda data, name=name: load_model(name), "selvage") for name in ("selvege", "no/such/folder")),
    ],
)
def test_bad_input_of_a_dataset_or_a_model_is_one_sentence(call, sentence, dataset):
    assert sentence in refusal(call, dataset)


FORKED = """
import multiprocessing
import numpy as np
import torch
from torch.utils.data import DataLoader
from twillight import Queries, evaluate, load_fabric, load_model

cloth = load_fabric("polyester_lining")
at = np.random.default_rng(0).uniform(0.0, 2.0, (2, 600))
queries = Queries.round(*at, np.full(600, 0.5), np.tile([0.6, 0.0, 0.8], (600, 1)), np.tile([0.0, 0.0, 1.0], (600, 1)))
methods = [load_model(name) for name in ("selvage", "soft_nodes:2", "point_sampled:2")]

def answers(_):
    few = evaluate(cloth, queries.take(slice(0, 50)), seed=3).mean
    return np.concatenate([part.ravel() for part in (few, *(method.predict(cloth, queries) for method in methods))])

own = answers(0)
torch.ones(1000, 1000) @ torch.ones(1000, 1000)
with multiprocessing.get_context("fork").Pool(2) as pool:
    print(*(np.array_equal(other, own) for other in pool.map(answers, range(2))))
loader = DataLoader([0, 1], collate_fn=answers, num_workers=2, multiprocessing_context="fork")
print(*(np.array_equal(other, own) for other in loader))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes do not fork here")
def test_forked_processes_answer_after_their_parent_has():
    """As multiprocessing and the loader of PyTorch start them; threads of torch and locks of kernels do not survive."""
    environment = {key: value for key, value in os.environ.items() if key != "OMP_NUM_THREADS"}
    command = [sys.executable, "-c", FORKED]
    ended = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=600)
    assert ended.stdout.split() == ["True"] * 4, ended.stderr
