"""`woven` as C++ against the Python that it mirrors, from exported files alone."""

import numpy as np
import pytest

from pipeline.models.registry import load_model, model_folder
from pipeline.shader.golden import rows_of
from pipeline.shards.queries import QueryOptions, draw_queries
from tests.pipeline.shader.conftest import ALLOWED, check_answers, read, woven_folder
from tests.refusals import refusal
from weaves.fabric import load_fabric

DESIGNS = {
    "local": {"hidden": 24},
    "published": {"hidden": 22, "bins": 4, "one_blob": "plain", "standard": False, "extra_layer": "encoder"},
}
# In standard position both are exchanged, the first is mirrored along both axes; the second repeats after 6 x 8 yarns.
FABRICS = ("cotton_twill", "silk_shantung")


@pytest.mark.external
@pytest.mark.parametrize("design", DESIGNS)
@pytest.mark.parametrize("name", FABRICS)
def test_golden_vectors_and_any_queries_are_answered(programs, exported, tmp_path_factory, design, name):
    folder = woven_folder(tmp_path_factory.mktemp("models") / design, **DESIGNS[design])
    cloth, fabric = read(exported(name, 2, "cpp", model=folder)), load_fabric(name)
    assert (cloth.answers[:, :4] > 0.0).mean() > 0.5 and np.ptp(cloth.answers, axis=0).min() > 0.02
    program = programs(folder, name)
    check_answers(program(cloth.buffers, cloth.queries), cloth, ALLOWED["C++"])
    (method,) = load_model(model_folder(folder, "test", "model", []))
    queries = draw_queries(QueryOptions(sigma=(1e-3, 500.0)), fabric.weave.repeat, 4, 0, 1000)
    expected = method.predict(fabric, queries)
    differences = np.abs(program(cloth.buffers, rows_of(queries))[:, :4] - expected) / np.ptp(expected, axis=0)
    assert differences.max() < ALLOWED["C++"]


def test_designs_without_a_shader_are_refused(exported, tmp_path):
    for key, value in (("one_blob", "periodic"), ("transmission", True), ("bins", 6)):
        folder = woven_folder(tmp_path / key, **{key: value})
        assert f"{key} = {value}" in refusal(exported, "denim", 2, model=folder)
