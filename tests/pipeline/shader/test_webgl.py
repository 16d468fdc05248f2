"""The GLSL ES form in a browser against the Python, on every fabric."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.pipeline.shader.conftest import ALLOWED
from tests.pipeline.shader.test_evaluate import EVERY, FEW, hemisphere, worst
from tests.presets import KINDS
from weaves.fabric import preset_names


@pytest.mark.parametrize("fabrics", [KINDS, pytest.param(preset_names(), marks=pytest.mark.slow)], ids=["some", "all"])
@pytest.mark.parametrize("half", [False, True], ids=["float32", "float16"])
def test_golden_vectors_are_answered(webgl, exported, read, fabrics, half):
    cloths = [read(exported(name)) for name in fabrics]
    answers, allowed = webgl(cloths, half), ALLOWED["16 bits" if half else "browser"]
    differences = {cloth.said["fabric"]: worst(found, cloth) for cloth, found in zip(cloths, answers, strict=True)}
    assert max(differences.values()) < allowed, differences
    for found in answers:
        assert np.isfinite(found).all() and (found >= 0.0).all() and (found[:, :4] <= found[:, 4:]).all()


def test_every_kind_and_directions_drawn_are_answered(webgl, cpp, exported, read):
    cloths = [read(exported(name, kinds=(EVERY,))) for name in FEW]
    answers, scattered = webgl(cloths), webgl(cloths, entry="scatter")
    for cloth, found, drawn in zip(cloths, answers, scattered, strict=True):
        assert max(worst(found, cloth), worst(drawn[:, [12, 11]], cloth, 8)) < ALLOWED["browser"]
        assert (found >= 0.0).all() and (found[:, :4] <= found[:, 4:]).all()
        rows = np.column_stack([cloth.queries, np.full((len(found), 3), 0.5)])
        expected = cpp(cloth.buffers, rows, "scatter")
        # One in a hundred may lie where the last digit chooses a lobe or a cell.
        off = (np.abs(drawn - expected) / np.maximum(np.ptp(expected, axis=0), 1.0)).max(axis=1) > ALLOWED["browser"]
        assert off.mean() < 0.01


def test_diffuse_components_make_no_light(webgl, exported, read):
    wi, solid = hemisphere(24)
    wo = np.tile((0.6, 0.0, 0.8), (len(wi), 1))
    buffers = read(exported("gauze")).buffers
    cloths = []
    for deviation in (0.05, 0.4):
        fixed = np.tile((0.3, 0.9, deviation, deviation, 0.0), (len(wi), 1))
        rows = np.column_stack([fixed, wi, wo, np.zeros(len(wi))]).astype(np.float32)
        cloths.append(SimpleNamespace(buffers=buffers, queries=rows))
    for found in webgl(cloths):
        # The rule has 24 x 24 directions: a kink of a clipped cosine costs it some 1e-2.
        assert 0.01 < solid @ found[:, 2:4].sum(axis=1) <= solid @ found[:, 6:8].sum(axis=1) < 1.02
