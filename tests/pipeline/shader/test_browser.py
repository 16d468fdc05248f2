"""The GLSL ES and WGSL forms in a browser against the Python, on every fabric."""

import numpy as np
import pytest

from pipeline.shader.tables import EVERY
from tests.pipeline.shader.conftest import ALLOWED, CLOTH, answered, apart, check_answers, job_of, read
from tests.pipeline.shader.test_evaluate import FEW
from tests.presets import KINDS, slow
from weaves.fabric import preset_names

pytestmark = pytest.mark.external  # slangc and Chromium

OPTIONS = ("--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader", "--enable-features=Vulkan")


@pytest.mark.parametrize("fabrics", [KINDS, slow(preset_names())], ids=["some", "all"])
@pytest.mark.parametrize("half", [False, True], ids=["float32", "float16"])
def test_golden_vectors_are_answered(webgl, exported, neumip, fabrics, half):
    for model, names in ((None, fabrics), (neumip, [CLOTH])):
        cloths = [read(exported(name, model=model)) for name in names]
        for cloth, answers in zip(cloths, webgl(cloths, half, model=model), strict=True):
            check_answers(answers, cloth, ALLOWED["16 bits" if half else "browser"])


def test_every_kind_and_directions_drawn_are_answered(webgl, cpp, exported):
    cloths = [*(read(exported(name, kinds=(EVERY,))) for name in FEW), read(exported("tartan"))]
    for cloth, answers, drawn in zip(cloths, webgl(cloths), webgl(cloths, entry="scatter"), strict=True):
        check_answers(answers, cloth, ALLOWED["browser"])
        assert apart(drawn[:, [12, 11, 8, 9, 10]], cloth, 8) < ALLOWED["browser"]
        rows = np.column_stack([cloth.queries, np.full((len(answers), 3), 0.5)])
        expected = cpp(cloth.buffers, rows, "scatter")
        # One in a hundred may lie where the last digit chooses a lobe or a cell.
        off = (np.abs(drawn - expected) / np.maximum(np.ptp(expected, axis=0), 1.0)).max(axis=1) > ALLOWED["browser"]
        assert off.mean() < 0.01


def test_golden_vectors_are_answered_by_webgpu(exported, tmp_path):
    source = (exported("gingham", 2, "wgsl") / "wgsl" / "evaluate.wgsl").read_text()
    cloth = read(exported("voile"))
    answers = answered("evaluate_wgsl.html", tmp_path, job_of(cloth.buffers, cloth.queries), source, *OPTIONS)
    if answers is None:
        pytest.skip("this browser has no WebGPU")
    check_answers(np.reshape(answers, (-1, 8)), cloth, ALLOWED["browser"])
