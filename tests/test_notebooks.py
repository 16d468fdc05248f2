"""The notebooks, executed from top to bottom in a fresh kernel."""

import itertools
import os
import sys
from pathlib import Path

import nbformat
import numpy as np
import pytest
from nbclient import NotebookClient

from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from tests.datasets import write_dataset
from weaves.fabric import load_fabric

pytestmark = pytest.mark.external  # kernels of notebooks

ROOT = Path(__file__).parents[1]


def true_rows(names, splits, rows=200):
    """Yield true rows of fabrics, for a data set."""
    for name, split in itertools.product(names, splits):
        fabric = load_fabric(name)
        queries = draw_queries(QueryOptions(sigma=(0.3, 8.0)), fabric.weave.repeat, len(split), 0, rows)
        yield name, split, 0, queries, estimate(fabric, queries, TruthOptions(), 1)


def executed(path, folder):
    """Execute a notebook, which is kept without results, in a folder; return it with them."""
    notebook = nbformat.read(path, as_version=4)
    assert not any(cell.outputs or cell.execution_count for cell in notebook.cells if cell.cell_type == "code")
    where = {"metadata": {"path": folder}}
    NotebookClient(notebook, kernel_name="python3", timeout=1800, startup_timeout=300, resources=where).execute()
    return notebook


def outputs(notebook, kind):
    """Return the outputs of a MIME type, or what was printed for `stream`."""
    found = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    if kind == "stream":
        return "".join(output.text for output in found if output.output_type == "stream" and output.name == "stdout")
    return [output.data[kind] for output in found if kind in output.get("data", {})]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder beside the sources in use, whose packages the kernel finds."""
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]))
    monkeypatch.setenv("JUPYTER_PLATFORM_DIRS", "1")  # no warning about the places of its settings
    return tmp_path


def test_a_fabric_from_draft_to_picture(folder):
    notebook = executed(ROOT / "notebooks" / "fabric_to_picture.ipynb", folder)
    assert len(outputs(notebook, "image/png")) == 2 and load_fabric(folder / "red_satin.toml").name == "red_satin"
    printed = [line.split() for line in outputs(notebook, "stream").splitlines()]
    assert [line[0] for line in printed] == ["specular_warp", "specular_weft", "diffuse_warp", "diffuse_weft"]
    assert all(float(line[1]) > 10 * float(line[3]) for line in printed), "errors are small beside the means"


def test_a_data_set_and_a_model(folder):
    """The model, which learns nothing, is within a tenth of the truth from .3 yarn on."""
    seen, unseen = ["polyester_lining", "denim"], ["twill_4_4"]
    parts = itertools.chain(true_rows(seen, ("train", "test")), true_rows(unseen, ("test",)))
    roles = {"seen": seen, "population": [], "unseen": unseen}
    write_dataset(folder / "out" / "datasets" / "smoke-0", roles, parts, "smoke")
    notebook = executed(ROOT / "notebooks" / "dataset_and_model.ipynb", folder)
    assert len(outputs(notebook, "image/png")) == 1 and len(outputs(notebook, "text/html")) == 1
    printed = outputs(notebook, "stream").splitlines()
    errors = {line.split()[0]: float(line.split(": ")[1].split("%")[0]) for line in printed[:3]}
    assert errors.keys() == {"polyester_lining", "denim", "twill_4_4"}
    assert np.all(np.array(list(errors.values())) < 10) and "'fabric': (200,)" in printed[3]


@pytest.mark.slow
def test_a_method_enters_the_benchmark(folder, monkeypatch):
    monkeypatch.setenv("PATH", os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]))
    notebook = executed(ROOT / "notebooks" / "method.ipynb", folder)
    assert len(outputs(notebook, "image/png")) == 1
    assert (folder / "out" / "report" / "mine" / "index.html").is_file(), outputs(notebook, "stream")
    assert "lambert.py, version 1, SHA-256 " in outputs(notebook, "stream")
    (table,) = outputs(notebook, "text/html")
    assert all(f"<th>{name}</th>" in table for name in ("lambert", "point_sampled", "colour_rrmse", "time"))
