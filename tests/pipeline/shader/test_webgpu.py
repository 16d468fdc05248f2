"""The WGSL form in a browser against the Python."""

import base64
import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from tests.pipeline.shader.conftest import ALLOWED, missing
from tests.pipeline.shader.test_evaluate import worst

pytestmark = pytest.mark.external  # slangc and Chromium

OPTIONS = ("--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader", "--enable-features=Vulkan")


@pytest.mark.parametrize("model", [None, pytest.param("selvage", marks=pytest.mark.slow)])
def test_golden_vectors_are_answered(exported, read, tmp_path, browse, model):
    if lacking := missing("slangc", "chromium"):
        pytest.skip(lacking)
    shutil.copy(exported("gingham", 2, "wgsl", model=model) / "wgsl" / "evaluate.wgsl", tmp_path)
    shutil.copy(Path(__file__).with_name("evaluate_wgsl.html"), tmp_path)
    cloth = read(exported("voile", model=model))
    columns = {**cloth.buffers, "queries": cloth.queries}
    encoded = {name: base64.b64encode(values.tobytes()).decode() for name, values in columns.items()}
    (tmp_path / "job.json").write_text(json.dumps({"names": list(columns), **encoded, "count": len(cloth.queries)}))
    said = browse("evaluate_wgsl.html", *OPTIONS)
    if b"requestDevice" in said or b"null" in said:
        pytest.skip(f"this browser has no WebGPU: {said.decode()}")
    assert not said.startswith(b"error"), said
    found = np.frombuffer(said, np.float32).reshape(-1, 8)
    assert worst(found, cloth) < ALLOWED["browser"]
    assert (found >= 0.0).all() and (found[:, :4] <= found[:, 4:]).all()
