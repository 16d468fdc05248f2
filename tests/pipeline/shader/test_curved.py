"""`curved` as C++ against the Python that it mirrors, from exported files alone."""

import shutil

import numpy as np
import pytest
import torch

from pipeline.models.curved import CurvedOptions
from pipeline.models.curved.model import CurvedNetwork
from pipeline.models.registry import load_model, model_folder
from pipeline.shader.golden import rows_of
from pipeline.shader.languages import Program, compile_program, slangc
from pipeline.shards.queries import QueryOptions, draw_queries
from tests.pipeline.shader.conftest import ALLOWED, CLOTH, check_answers, random_folder, read
from tests.refusals import refusal
from weaves.fabric import load_fabric

FABRIC = load_fabric(CLOTH)
DESIGNS = {
    "opacity": {"hidden": 18},
    "grazing": {"silhouette": "grazing", "curvature_input": "linear", "directions": "projected", "levels": 1},
}
COVERED = """#include "model.slang"
StructuredBuffer<float> queries;
RWStructuredBuffer<float4> answers;
[shader("compute")]
[numthreads(64, 1, 1)]
void evaluate(uint3 id : SV_DispatchThreadID) {
    int n = 12 * int(id.x);
    Query query;
    query.centre = float2(queries[n], queries[n + 1]);
    query.deviation = float2(queries[n + 2], queries[n + 3]);
    query.correlation = queries[n + 4];
    query.wi = float3(queries[n + 5], queries[n + 6], queries[n + 7]);
    query.wo = float3(queries[n + 8], queries[n + 9], queries[n + 10]);
    query.curvature = queries[n + 11];
    answers[2 * int(id.x)] = coverage(query);
}
"""


def trained(folder, **options):
    with torch.random.fork_rng():
        torch.manual_seed(7)
        network = CurvedNetwork(CurvedOptions(texels_per_yarn=4, **options), FABRIC.weave.repeat, fall=0.5)
        for name, values in network.named_parameters():
            if name.startswith(("levels", "depth", "opacity_levels")):
                values.data += torch.randn_like(values)
    return random_folder(folder, network, "decoder.6.bias", FABRIC)


@pytest.mark.external
@pytest.mark.parametrize("design", DESIGNS)
def test_golden_vectors_any_queries_and_coverage_are_answered(programs, exported, tmp_path_factory, compiled, design):
    folder = trained(tmp_path_factory.mktemp("models") / design, **DESIGNS[design])
    home = exported(CLOTH, 2, "cpp", model=folder)
    cloth, program = read(home), programs(folder)
    assert cloth.about["kinds"] == ["curvature"] and set(cloth.groups) == {"front", "curved"}
    assert (cloth.answers[:, :4] > 0.0).mean() > 0.5 and np.ptp(cloth.answers, axis=0).min() > 0.02
    check_answers(program(cloth.buffers, cloth.queries), cloth, ALLOWED["C++"])
    (method,) = load_model(model_folder(folder, "test", "model", []))
    drawn = QueryOptions(sigma=(1e-3, 500.0), curvature=(0.01, 0.5), max_angle=89.0)
    queries = draw_queries(drawn, FABRIC.weave.repeat, 4, 0, 1000)
    expected = method.predict(FABRIC, queries)
    differences = np.abs(program(cloth.buffers, rows_of(queries))[:, :4] - expected) / np.ptp(expected, axis=0)
    assert differences.max() < ALLOWED["C++"]

    own = tmp_path_factory.mktemp("covered")
    shutil.copytree(home / "slang", own / "slang")
    (own / "slang" / "covered.slang").write_text(COVERED)
    compile_program(slangc(), own / "slang", Program("c", ("evaluate",), "covered.slang"), "cpp", own / "covered.cpp")
    covered = compiled(own / "covered.cpp")(cloth.buffers, rows_of(queries))[:, 0]
    truth = method.coverage(FABRIC, queries)
    assert (truth < 1.0).mean() > 0.05 and np.ptp(truth) > 0.1
    np.testing.assert_allclose(covered, truth, atol=ALLOWED["C++"])


def test_light_from_behind_is_not_in_the_shader(exported, tmp_path):
    folder = trained(tmp_path / "curved")
    assert "in front of cloth only" in refusal(exported, CLOTH, 2, kinds=("behind",), model=folder)
    assert read(exported(CLOTH, 2, kinds=("curvature",), model=folder)).about["kinds"] == ["curvature"]
