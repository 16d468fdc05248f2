"""The exported folder, and the sentences for what cannot be exported."""

import json
import re
import shutil
import subprocess

import numpy as np
import pytest

from pipeline.analytic.soft_nodes.nodes import tabulate
from pipeline.shader import languages
from pipeline.shader.descriptor import Buffer, Descriptor, Networks, PlacedLayer
from pipeline.shader.languages import LANGUAGES
from pipeline.truth.conventions import COMPONENTS
from tests.pipeline.shader.conftest import FORMAT_PAGE, missing
from tests.presets import PRESETS
from weaves.fabric import load_fabric


def bytes_of(folder):
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


@pytest.fixture(scope="module")
def largest(exported):
    """Bytes of the longest programs of a language, which are those of every fabric; CUDA brings its own definitions."""
    if lacking := missing("slangc"):
        pytest.skip(lacking)
    folder = exported("gingham", 2, "all")
    return max(bytes_of(folder / name) for name in LANGUAGES if name != "cuda")


@pytest.mark.external
@pytest.mark.parametrize("name", PRESETS)
def test_a_folder_has_less_than_a_megabyte_with_a_language(exported, largest, name):
    assert bytes_of(exported(name)) + largest < 1_000_000


def test_tables_are_those_of_the_fabric(exported, read):
    table, cloth = tabulate(load_fabric("crepe")), read(exported("crepe"))
    said, nodes = cloth.said, cloth.buffers["nodes"].reshape(-1, cloth.said["scalars"]["stride"], 4)
    assert said["components"] == list(COMPONENTS) and said["repeat"] == [16, 16] and said["level"] == 2
    for buffer, name, expected in (
        ("numbers", "yarn", table.yarn), ("numbers", "bounds", table.bounds), ("integers", "pieces", table.pieces)
    ):  # fmt: skip
        place = said["buffers"][buffer]["arrays"][name]
        count = int(np.prod(place["shape"]))
        values = cloth.buffers[buffer][place["offset"] : place["offset"] + count].reshape(place["shape"])
        assert (values == expected).all()
    assert (cloth.buffers["grid"][: table.grid.size] == table.grid.ravel()).all()
    block, lane = 5, 3
    node = nodes[16 * block + lane]
    assert (node[0] == table.nodes[block, :4, lane]).all() and node[1, 3] == table.evenly[block, lane]
    horizons = node[4:20].reshape(32, 2)
    assert (horizons[:, 0] == table.mean[:, block, lane]).all()
    assert (horizons[:, 1] == table.sharpness[:, block, lane]).all()
    wave = 13
    assert (node[20:].reshape(-1, 2)[wave] == table.wave_nodes[block, wave // 4, 2 * (wave % 4) :][:2, lane]).all()


def test_slangc_of_the_search_path_is_found(monkeypatch):
    monkeypatch.setattr(languages, "find_spec", lambda name: None)
    monkeypatch.setattr(shutil, "which", lambda name: f"/opt/{name}")
    assert str(languages.slangc()) == "/opt/slangc"


@pytest.mark.external
def test_every_language_is_written(exported):
    if lacking := missing("slangc"):
        pytest.skip(lacking)
    folder = exported("gingham", 2, "all")
    said = json.loads((folder / "soft_nodes.json").read_text())["languages"]
    assert set(said) == set(LANGUAGES)
    for name, files in said.items():
        for file, program in zip(files, LANGUAGES[name].programs, strict=True):
            for entry in program.entries:
                assert re.search(rf"\b({entry}|main)\(", (folder / file).read_text())


def test_no_sine_and_no_cosine_is_called(exported):
    for path in exported("gingham").glob("slang/*.slang"):
        assert not re.search(r"\b(sin|cos|tan|atan2?|asin|acos|exp2?|log2?)\(", path.read_text()), path


@pytest.mark.external
@pytest.mark.parametrize(
    ("name", "file", "options"),
    [
        ("glsl", "evaluate.comp", ()),
        ("glsl", "scatter.comp", ()),
        ("glsles", "evaluate.frag", ()),
        ("glsles", "draw.frag", ()),
        ("hlsl", "evaluate.hlsl", ("-V", "-D", "-e", "evaluate", "-S", "comp", "-o", "/dev/null")),
        ("hlsl", "scatter.hlsl", ("-V", "-D", "-e", "scatter", "-S", "comp", "-o", "/dev/null")),
    ],
)
def test_glslang_accepts_what_is_written(exported, name, file, options):
    if lacking := missing("slangc"):
        pytest.skip(lacking)
    if shutil.which("glslangValidator") is None:
        pytest.skip("glslangValidator is not installed")
    path = exported("gingham", 2, "all") / name / file
    done = subprocess.run(["glslangValidator", *options, path], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


@pytest.mark.external
def test_nvcc_accepts_the_cuda_form(exported, tmp_path):
    if lacking := missing("slangc"):
        pytest.skip(lacking)
    if shutil.which("nvcc") is None:
        pytest.skip("nvcc is not installed")
    path = exported("gingham", 2, "all") / "cuda" / "evaluate.cu"
    done = subprocess.run(
        ["nvcc", "--ptx", "-w", "-o", tmp_path / "evaluate.ptx", path], capture_output=True, text=True
    )
    assert done.returncode == 0 and "evaluate" in (tmp_path / "evaluate.ptx").read_text(), done.stderr


def test_the_page_on_the_format_has_every_key_of_the_descriptor():
    page = FORMAT_PAGE.read_text(encoding="utf-8")
    for part in (Descriptor, Buffer, Networks, PlacedLayer):
        rows = [f"| `{name}` | {field.description.rstrip('.')} |" for name, field in part.model_fields.items()]
        assert "\n".join(rows) in page, f"docs/shader_format.md needs, of {part.__name__}:\n" + "\n".join(rows)
