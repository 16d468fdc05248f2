"""Models with a network as C++ and ONNX against the Python that they mirror, from exported files alone."""

import numpy as np
import onnxruntime
import pytest

from pipeline.analytic.soft_nodes.features import OF_QUERY, read_queries
from pipeline.analytic.soft_nodes.nodes import tabulate
from pipeline.models.method import in_repeat
from pipeline.models.registry import load_model, model_folder
from pipeline.shader.golden import rows_of
from pipeline.shards.queries import QueryOptions, draw_queries
from tests.pipeline.shader.conftest import ALLOWED, CLOTH, FORMS, bytes_of, check_answers, read
from tests.pipeline.shader.test_evaluate import UNSEEN
from tests.presets import PRESETS, slow
from weaves.fabric import load_fabric, preset_names

TWO = ("crepe", "polyester_lining")
"""The largest repeat, and the smallest: in all fabrics the network is the same."""


@pytest.fixture(scope="session")
def selvage():
    (method,) = load_model(model_folder("selvage", "test", "model"))
    return method


def differences(answers, expected):
    """Return the differences of components (N, 4), as shares of the ranges of their columns."""
    return np.abs(answers[:, :4] - expected) / np.ptp(expected, axis=0)


@pytest.mark.parametrize(("form", "allowed"), FORMS)
@pytest.mark.parametrize("name", PRESETS)
def test_selvage_answers_its_golden_vectors(programs, exported, name, form, allowed):
    cloth = read(exported(name, model="selvage"), form)
    check_answers(programs("selvage")(cloth.buffers, cloth.queries), cloth, allowed)


@pytest.mark.parametrize(("form", "allowed"), FORMS)
def test_neumip_answers_its_golden_vectors(programs, neumip, exported, form, allowed):
    cloth = read(exported(CLOTH, model=neumip), form)
    check_answers(programs(neumip)(cloth.buffers, cloth.queries), cloth, allowed)
    assert (cloth.answers[:, :4] > 0.0).mean() > 0.5 and np.ptp(cloth.answers, axis=0).min() > 0.05


@pytest.mark.parametrize("name", [name if name in TWO else slow(name) for name in preset_names()])
def test_golden_vectors_are_those_of_the_method(exported, name):
    """A network that changes nothing would pass all other tests with wrong weights."""
    cloth = read(exported(name, model="selvage"))
    soft = read(exported(name))
    assert (cloth.queries == soft.queries).mean() > 0.5
    same = (cloth.queries == soft.queries).all(axis=1)
    change = np.abs(cloth.answers[same, :4] - soft.answers[same, :4]) / np.ptp(soft.answers[:, :4], axis=0)
    assert np.median(change.max(axis=1)) > 1e-3
    assert bytes_of(exported(name, model="selvage")) - bytes_of(exported(name)) < 100_000


@pytest.mark.parametrize("name", UNSEEN)
def test_other_queries_of_selvage_are_answered(selvage, programs, exported, name):
    """As for the soft nodes, at most 1 % of them hang on the last digit of a place."""
    fabric, cloth = load_fabric(name), read(exported(name, model="selvage"))
    queries = draw_queries(QueryOptions(stretch=8.0), fabric.weave.repeat, 12, 0, 2000)
    answers = programs("selvage")(cloth.buffers, rows_of(queries))
    off = differences(answers, selvage.predict(fabric, queries)).max(axis=1) > ALLOWED["C++"]
    assert off.mean() < 0.01


def test_neumip_answers_beyond_its_repeat_and_its_levels(programs, neumip, exported):
    fabric, cloth = load_fabric(CLOTH), read(exported(CLOTH, model=neumip))
    (method,) = load_model(model_folder(neumip, "test", "model"))
    queries = draw_queries(QueryOptions(sigma=(1e-3, 500.0)), fabric.weave.repeat, 4, 0, 1000)
    queries = queries._replace(u=queries.u - np.float32(64.0), v=queries.v + np.float32(32.0))
    answers = programs(neumip)(cloth.buffers, rows_of(queries))
    assert differences(answers, method.predict(fabric, queries)).max() < ALLOWED["C++"]


def forward(cloth, network, inputs):
    """Return outputs of a network as the descriptor says, before the last function."""
    buffer, values = cloth.about["buffers"]["weights"], cloth.buffers["weights"]

    def array(place):
        start = buffer["channels"] * place["offset"]
        return values[start : start + int(np.prod(place["shape"]))].reshape(place["shape"])

    layers = [layer for layer in cloth.about["network"]["layers"] if layer["network"] == network]
    x = np.pad(inputs, ((0, 0), (0, -inputs.shape[1] % 4)))
    for layer in layers:
        x = array(layer["biases"]) + x @ array(layer["weights"])
        if layer is not layers[-1]:
            x = np.where(x > 0.0, x, {"ReLU": 0.0, "leaky ReLU of slope 0.01": 0.01}[layer["activation"]] * x)
    return x


def test_the_descriptor_says_what_the_networks_compute(exported, selvage):
    cloth, fabric = read(exported("crepe", model="selvage")), load_fabric("crepe")
    queries = draw_queries(QueryOptions(), fabric.weave.repeat, 5, 0, 500)
    found = read_queries(tabulate(fabric), queries)
    assert len(cloth.about["network"]["inputs"]["correction"]) == OF_QUERY
    factors = 2.0 / (1.0 + np.exp(-forward(cloth, "correction", found.features[:, :OF_QUERY])))
    answer = np.minimum(factors * found.components, found.bounds)
    np.testing.assert_allclose(answer, selvage.predict(fabric, queries), rtol=1e-4, atol=1e-6)


@pytest.mark.slow
def test_networks_alone_run_by_onnx(exported, selvage, neumip):
    for name, model in (("denim", "selvage"), (CLOTH, neumip)):
        fabric, folder = load_fabric(name), exported(name, 2, "onnx", model=model)
        queries = draw_queries(QueryOptions(), fabric.weave.repeat, 5, 0, 500)
        if model == "selvage":
            method, found = selvage, read_queries(tabulate(fabric), queries)
            inputs = dict(zip(("features", "soft_components", "soft_bounds"), found, strict=True))
            inputs["features"] = np.ascontiguousarray(inputs["features"][:, :OF_QUERY])
        else:
            (method,) = load_model(model_folder(neumip, "test", "model"))
            inside = in_repeat(queries, fabric.weave.repeat)
            inputs = {name: getattr(inside, name) for name in ("u", "v", "sigma", "wi", "wo")}
        about = read(folder).about
        assert about["languages"] == {"onnx": ["onnx/network.onnx"]} and set(about["network"]["onnx"]) == set(inputs)
        session = onnxruntime.InferenceSession(folder / "onnx" / "network.onnx", providers=["CPUExecutionProvider"])
        (answers,) = session.run(None, inputs)
        assert differences(answers, method.predict(fabric, queries)).max() < ALLOWED["ONNX"]
