"""The GLSL ES form in a browser against the Python, on every fabric."""

import numpy as np
import pytest

from tests.jobs.verbs.exchange.shader.test_evaluate import FABRICS, worst


@pytest.fixture(scope="module")
def cloths(exported, read):
    return [read(exported(name)) for name in FABRICS]


@pytest.mark.parametrize(("half", "allowed"), [(False, 1e-4), (True, 1e-2)], ids=["float32", "float16"])
def test_golden_vectors_are_answered(webgl, cloths, half, allowed):
    answers = webgl(cloths, half)
    differences = {
        cloth.said["fabric"]: worst(found, cloth.answers) for cloth, found in zip(cloths, answers, strict=True)
    }
    assert max(differences.values()) < allowed, differences
    for found in answers:
        assert np.isfinite(found).all() and (found >= 0.0).all() and (found[:, :4] <= found[:, 4:]).all()
