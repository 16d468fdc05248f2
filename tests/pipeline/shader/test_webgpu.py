"""The WGSL form in a browser against the Python."""

import numpy as np
import pytest

from tests.pipeline.shader.conftest import ALLOWED, answered, check_answers, job_of, read
from tests.presets import slow

pytestmark = pytest.mark.external  # slangc and Chromium

OPTIONS = ("--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader", "--enable-features=Vulkan")


@pytest.mark.parametrize("model", [None, slow("selvage")])
def test_golden_vectors_are_answered(exported, tmp_path, model):
    source = (exported("gingham", 2, "wgsl", model=model) / "wgsl" / "evaluate.wgsl").read_text()
    cloth = read(exported("voile", model=model))
    answers = answered("evaluate_wgsl.html", tmp_path, job_of(cloth.buffers, cloth.queries), source, *OPTIONS)
    if answers is None:
        pytest.skip("this browser has no WebGPU")
    check_answers(np.reshape(answers, (-1, 8)), cloth, ALLOWED["browser"])
