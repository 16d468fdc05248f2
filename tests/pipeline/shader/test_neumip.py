"""`neumip` as C++ and ONNX against the Python that it mirrors, from exported files alone."""

import numpy as np
import onnxruntime
import pytest

from pipeline.models.method import in_repeat
from pipeline.models.registry import load_model, model_folder
from pipeline.shader.golden import rows_of
from pipeline.shards.queries import QueryOptions, draw_queries
from tests.pipeline.shader.conftest import ALLOWED, CLOTH, FORMS, check_answers, read
from weaves.fabric import load_fabric

FABRIC = load_fabric(CLOTH)


@pytest.fixture
def method(neumip):
    (method,) = load_model(model_folder(neumip, "test", "model", []))
    return method


def differences(answers, expected):
    """Return the differences of components (N, 4), as shares of the ranges of their columns."""
    return np.abs(answers[:, :4] - expected) / np.ptp(expected, axis=0)


@pytest.mark.external
@pytest.mark.parametrize(("form", "allowed"), FORMS)
def test_golden_vectors_are_answered(programs, neumip, exported, form, allowed):
    cloth = read(exported(CLOTH, model=neumip), form)
    check_answers(programs(neumip)(cloth.buffers, cloth.queries), cloth, allowed)


@pytest.mark.external
def test_queries_beyond_its_repeat_and_its_levels_are_answered(programs, neumip, exported, method):
    queries = draw_queries(QueryOptions(sigma=(1e-3, 500.0)), FABRIC.weave.repeat, 4, 0, 1000)
    queries = queries._replace(u=queries.u - np.float32(64.0), v=queries.v + np.float32(32.0))
    answers = programs(neumip)(read(exported(CLOTH, model=neumip)).buffers, rows_of(queries))
    assert differences(answers, method.predict(FABRIC, queries)).max() < ALLOWED["C++"]


def forward(cloth, network, inputs):
    """Return outputs of a network as the descriptor says."""
    buffer, values = cloth.about["buffers"]["weights"], cloth.buffers["weights"]

    def array(place):
        start = buffer["channels"] * place["offset"]
        return values[start : start + int(np.prod(place["shape"]))].reshape(place["shape"])

    x = inputs
    for layer in [layer for layer in cloth.about["network"]["layers"] if layer["network"] == network]:
        x = array(layer["biases"]) + x @ array(layer["weights"])
        x = {"ReLU": np.maximum(x, 0.0), "none": x}[layer["activation"]]
    return x


def test_the_descriptor_says_what_the_decoder_computes(exported, neumip, method):
    """With golden components that hardly vary, all other tests would pass with wrong weights."""
    cloth, seen = read(exported(CLOTH, model=neumip)), []
    assert (cloth.answers[:, :4] > 0.0).mean() > 0.5 and np.ptp(cloth.answers, axis=0).min() > 0.05
    queries = draw_queries(QueryOptions(), FABRIC.weave.repeat, 5, 0, 500)
    network = method.network_of(FABRIC)
    hook = network.decoder.register_forward_hook(lambda _, given, output: seen.append(given[0].numpy()))
    expected = method.predict(FABRIC, queries)
    hook.remove()
    names, features = cloth.about["network"]["inputs"]["decoder"], np.concatenate(seen)
    columns = [name for name in names if name != "0"]
    inputs = np.zeros((500, len(names)), np.float32)
    inputs[:, [names.index(name) for name in columns]] = features
    output = forward(cloth, "decoder", inputs)
    specular = np.expm1(output[:, :2]) / network.options.log_k
    answer = np.maximum(np.concatenate([specular, output[:, 2:]], axis=1), 0.0)
    assert columns[-4:] == ["wi.x", "wi.y", "wo.x", "wo.y"] and (expected > 0.0).mean() > 0.5
    np.testing.assert_allclose(answer, expected, rtol=1e-4, atol=1e-6)


@pytest.mark.slow
def test_the_network_alone_runs_by_onnx(exported, neumip, method):
    folder = exported(CLOTH, 2, "onnx", model=neumip)
    queries = draw_queries(QueryOptions(), FABRIC.weave.repeat, 5, 0, 500)
    inside = in_repeat(queries, FABRIC.weave.repeat)
    inputs = {name: getattr(inside, name) for name in ("u", "v", "sigma", "wi", "wo")}
    about = read(folder).about
    assert about["languages"] == {"onnx": ["onnx/network.onnx"]} and set(about["network"]["onnx"]) == set(inputs)
    content = (folder / "onnx" / "network.onnx").read_bytes()
    assert np.__file__.partition("/numpy")[0].encode() not in content  # alike on every machine
    session = onnxruntime.InferenceSession(content, providers=["CPUExecutionProvider"])
    (answers,) = session.run(None, inputs)
    assert differences(answers, method.predict(FABRIC, queries)).max() < ALLOWED["ONNX"]
