"""The GLSL ES form in a browser against the Python, on every fabric."""

import numpy as np
import pytest

from pipeline.shader.tables import EVERY
from tests.pipeline.shader.conftest import ALLOWED, check_answers, read, worst
from tests.pipeline.shader.test_evaluate import FEW
from tests.presets import KINDS, slow
from weaves.fabric import preset_names


@pytest.mark.parametrize("fabrics", [KINDS, slow(preset_names())], ids=["some", "all"])
@pytest.mark.parametrize("half", [False, True], ids=["float32", "float16"])
def test_golden_vectors_are_answered(webgl, exported, fabrics, half):
    cloths = [read(exported(name)) for name in fabrics]
    for cloth, answers in zip(cloths, webgl(cloths, half), strict=True):
        check_answers(answers, cloth, ALLOWED["16 bits" if half else "browser"])


def test_every_kind_and_directions_drawn_are_answered(webgl, cpp, exported):
    cloths = [read(exported(name, kinds=(EVERY,))) for name in FEW]
    for cloth, answers, drawn in zip(cloths, webgl(cloths), webgl(cloths, entry="scatter"), strict=True):
        check_answers(answers, cloth, ALLOWED["browser"])
        assert worst(drawn[:, [12, 11]], cloth, 8) < ALLOWED["browser"]
        rows = np.column_stack([cloth.queries, np.full((len(answers), 3), 0.5)])
        expected = cpp(cloth.buffers, rows, "scatter")
        # One in a hundred may lie where the last digit chooses a lobe or a cell.
        off = (np.abs(drawn - expected) / np.maximum(np.ptp(expected, axis=0), 1.0)).max(axis=1) > ALLOWED["browser"]
        assert off.mean() < 0.01
