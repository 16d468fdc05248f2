"""The GLSL ES form in a browser against the Python, on every fabric."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.jobs.verbs.exchange.shader.test_evaluate import FABRICS, hemisphere, worst


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


def test_diffuse_components_make_no_light(webgl, exported, read):
    wi, solid = hemisphere(24)
    wo = np.tile((0.6, 0.0, 0.8), (len(wi), 1))
    buffers = read(exported("gauze")).buffers
    cloths = []
    for deviation in (0.05, 0.4):
        fixed = np.tile((0.3, 0.9, deviation, deviation, 0.0), (len(wi), 1))
        rows = np.column_stack([fixed, wi, wo]).astype(np.float32)
        cloths.append(SimpleNamespace(buffers=buffers, queries=rows))
    for found in webgl(cloths):
        # The rule has 24 x 24 directions: a kink of a clipped cosine costs it some 1e-2.
        assert 0.01 < solid @ found[:, 2:4].sum(axis=1) <= solid @ found[:, 6:8].sum(axis=1) < 1.02
