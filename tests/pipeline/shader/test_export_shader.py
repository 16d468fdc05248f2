"""The exported folder, and the sentences for what cannot be exported."""

import re
import shutil
import subprocess

import numpy as np
import pytest

from pipeline.analytic.soft_horizons import AZIMUTHS
from pipeline.analytic.soft_nodes.nodes import tabulate
from pipeline.analytic.soft_nodes.seen_areas import SEEN_ANGLES
from pipeline.shader.descriptor import Buffer, Descriptor, Networks, PlacedLayer
from pipeline.shader.languages import LANGUAGES
from pipeline.truth.conventions import COMPONENTS
from tests.pipeline.shader.conftest import FORMAT_PAGE, bytes_of, read
from tests.presets import KINDS
from weaves.fabric import load_fabric


@pytest.fixture(scope="module")
def every(exported):
    return exported("gingham", 2, "all")


@pytest.mark.external
def test_a_folder_has_less_than_two_megabytes_with_a_language(exported, every):
    """Of KINDS crepe has most nodes; C++ is the longest language but CUDA, which brings its own definitions."""
    sizes = {language: bytes_of(every / language) for language in LANGUAGES if language != "cuda"}
    nodes = {name: tabulate(load_fabric(name)).evenly.size for name in KINDS}
    assert max(sizes, key=sizes.get) == "cpp" and max(nodes, key=nodes.get) == "crepe"
    assert bytes_of(exported("crepe")) + sizes["cpp"] < 2_000_000


def test_tables_are_those_of_the_fabric(exported):
    table, cloth = tabulate(load_fabric("denim")), read(exported("denim"))
    about, nodes = cloth.about, cloth.buffers["nodes"].reshape(-1, cloth.about["scalars"]["stride"], 4)
    assert about["components"] == list(COMPONENTS) and about["repeat"] == [4, 4] and about["level"] == 2
    for buffer, name, expected in (
        ("numbers", "yarn", table.yarn), ("numbers", "bounds", table.bounds), ("integers", "pieces", table.pieces)
    ):  # fmt: skip
        place = about["buffers"][buffer]["arrays"][name]
        count = int(np.prod(place["shape"]))
        values = cloth.buffers[buffer][place["offset"] : place["offset"] + count].reshape(place["shape"])
        assert (values == expected).all()
    assert (cloth.buffers["grid"][: table.grid.size] == table.grid.ravel()).all()
    block, lane = 4, 3
    node = nodes[16 * block + lane]
    assert (node[0] == table.nodes[block, :4, lane]).all() and node[1, 3] == table.evenly[block, lane]
    horizons = node[4:20].reshape(32, 2)
    assert (horizons[:, 0] == table.mean[:, block, lane]).all()
    assert (horizons[:, 1] == table.sharpness[:, block, lane]).all()
    assert (node[20:].reshape(SEEN_ANGLES, AZIMUTHS) == table.areas[..., block, lane].T).all()


@pytest.mark.external
def test_every_language_is_written(every):
    languages_written = read(every).about["languages"]
    assert set(languages_written) == set(LANGUAGES)
    for name, files in languages_written.items():
        for file, program in zip(files, LANGUAGES[name].programs, strict=True):
            for entry in program.entries:
                assert re.search(rf"\b({entry}|main)\(", (every / file).read_text())


def test_no_sine_is_called_and_the_page_on_the_format_has_every_key_of_the_descriptor(exported):
    for path in exported("denim").glob("slang/*.slang"):
        assert not re.search(r"\b(sin|cos|tan|atan2?|asin|acos|exp2?|log2?)\(", path.read_text()), path
    page = FORMAT_PAGE.read_text(encoding="utf-8")
    for part in (Descriptor, Buffer, Networks, PlacedLayer):
        rows = [f"| `{name}` | {field.description.rstrip('.')} |" for name, field in part.model_fields.items()]
        assert "\n".join(rows) in page, f"docs/shader_format.md needs, of {part.__name__}:\n" + "\n".join(rows)


@pytest.mark.external
@pytest.mark.parametrize(
    "file",
    [
        "glsl/evaluate.comp", "glsl/scatter.comp", "glsles/evaluate.frag", "glsles/draw.frag",
        "hlsl/evaluate.hlsl", "hlsl/scatter.hlsl", "cuda/evaluate.cu",
    ],
)  # fmt: skip
def test_compilers_accept_what_is_written(every, tmp_path, file):
    path, made = every / file, tmp_path / "made"
    program, *options = {
        ".hlsl": ["glslangValidator", "-V", "-D", "-e", path.stem, "-S", "comp", "-o", made],
        ".cu": ["nvcc", "--ptx", "-w", "-o", made],
    }.get(path.suffix, ["glslangValidator"])
    if shutil.which(program) is None:
        pytest.skip(f"{program} is not installed")
    done = subprocess.run([program, *options, path], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert path.suffix != ".cu" or "evaluate" in made.read_text()
