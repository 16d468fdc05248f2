"""The examples of docs/shader_examples.md, word for word: the picture in a browser and the node in C++."""

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from pipeline.shader.golden import DENSITY_COLUMN, TRANSPARENCY_COLUMN
from tests.browser import opened, served
from tests.pipeline.shader.conftest import ALLOWED, read
from weaves.colour import encoded

pytestmark = pytest.mark.external  # slangc, g++ and Chromium

PAGE = Path(__file__).parents[3] / "docs" / "shader_examples.md"


def example(language):
    """Return the code block of a language; there is one."""
    (code,) = re.findall(rf"^```{language}\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.M | re.S)
    return code


def test_the_quad_draws_what_the_shader_answers(exported, cpp, tmp_path):
    shutil.copytree(exported("denim", 2, "glsles"), tmp_path / "shaders" / "denim")
    (tmp_path / "quad.html").write_text(example("html"))
    ready = "document.title === 'drawn'"
    with served(tmp_path) as address, opened(f"{address}/quad.html", tmp_path / "profile", ready=ready) as page:
        row = page.run("""(() => {
            const gl = document.getElementById("cloth").getContext("webgl2"), seen = new Uint8Array(4 * 256);
            gl.readPixels(0, 100, 256, 1, gl.RGBA, gl.UNSIGNED_BYTE, seen);
            return Array.from(seen);
        })()""")
    pixels = np.reshape(row, (256, 4))[:, :3].astype(float)

    # The camera of the page: row 100 of 256, eight yarns wide, from 40 yarns above.
    cloth, side = read(exported("denim")), 8.0 / 256.0
    ray = np.stack([(np.arange(256) - 127.5) * side, np.full(256, -27.5 * side), np.full(256, -40.0)], axis=-1)
    wo = -ray / np.linalg.norm(ray, axis=1, keepdims=True)
    rows = np.zeros((256, 12))
    rows[:, :2], rows[:, 2:4], rows[:, 5:8], rows[:, 8:11] = 4.0 + ray[:, :2], 0.5 * side, (0.48, 0.36, 0.8), wo
    colours = np.array(list(cloth.about["colours"].values()))[:4]
    expected = 255.0 * encoded(np.minimum(3.0 * cpp(cloth.buffers, rows)[:, :4] @ colours, 1.0))
    # Places are rounded in another order, which moves a few of them into the next cell of a grid.
    assert np.ptp(expected) > 50.0 and (np.abs(pixels - expected).max(axis=1) <= 1.0).mean() > 0.98


def test_the_node_answers_the_golden_queries(exported, tmp_path):
    if not Path("/usr/include/stb/stb_image.h").exists():
        pytest.skip("stb_image.h is not installed")
    folder, program = exported("denim", 2, "cpp", kinds=("behind",)), tmp_path / "node"
    (tmp_path / "node.cpp").write_text(example("cpp"))
    command = ["g++", "-O2", "-w", tmp_path / "node.cpp", folder / "cpp" / "evaluate.cpp", "-o", program]
    subprocess.run(command, check=True)
    cloth = read(folder)
    rows = "\n".join(" ".join(f"{value:.9g}" for value in row) for row in cloth.queries)
    done = subprocess.run([program, folder], input=rows, capture_output=True, text=True, check=True)
    answers = np.array([line.split() for line in done.stdout.splitlines()], float)
    colours = np.array(list(cloth.about["colours"].values()))
    through = cloth.queries[:, 7] * cloth.queries[:, 10] < 0.0
    components = cloth.answers[:, :4]
    values = np.where(through[:, None], components @ colours[[0, 1, 4, 5]], components @ colours[:4])
    expected = np.column_stack([values, cloth.answers[:, [DENSITY_COLUMN, TRANSPARENCY_COLUMN]]])
    for start, stop in cloth.groups.values():
        span = np.ptp(expected[start:stop], axis=0)
        assert (np.abs(answers - expected)[start:stop] < ALLOWED["C++"] * span).all()
