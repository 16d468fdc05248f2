"""Models with a network as C++, GLSL ES and ONNX against the Python that they mirror, from exported files alone."""

import json

import numpy as np
import onnxruntime
import pytest
import safetensors.torch
import torch

from pipeline.analytic.soft_nodes.features import OF_QUERY, read_queries
from pipeline.analytic.soft_nodes.nodes import tabulate
from pipeline.fingerprint import IDENTITY, fingerprint
from pipeline.models.card import write_model
from pipeline.models.method import in_repeat
from pipeline.models.neumip import NeumipOptions
from pipeline.models.neumip.model import NeumipNetwork
from pipeline.models.registry import load_model, model_folder
from pipeline.shader.golden import rows_of
from pipeline.shards.queries import QueryOptions, draw_queries
from tests.pipeline.shader.conftest import ALLOWED, compiled, missing
from tests.pipeline.shader.test_evaluate import UNSEEN, hemisphere
from tests.presets import PRESETS
from weaves.fabric import load_fabric, preset_names

SOME = ("crepe", "gauze", "gingham", "silk_charmeuse")
"""Fabrics of the fast tests: the largest repeat, open cloth, the smallest repeat, long floats."""

CLOTH = "gingham"
"""The fabric of the trained `neumip`."""


@pytest.fixture(scope="session")
def selvage():
    (method,) = load_model(model_folder("selvage", "test", "model"))
    return method


@pytest.fixture(scope="session")
def selvage_cpp(exported, tmp_path_factory):
    if lacking := missing("slangc", "g++"):
        pytest.skip(lacking)
    return compiled(exported(CLOTH, 2, "cpp", "glsles", model="selvage"), tmp_path_factory.mktemp("selvage"))


def neumip_folder(folder, fabric, version=1, **options):
    """Write a `neumip` whose random textures and perceptrons give components of all sizes."""
    design = NeumipOptions(**options)
    with torch.random.fork_rng():
        torch.manual_seed(3)
        network = NeumipNetwork(design, fabric.weave.repeat)
        weights = {
            name: values + torch.randn_like(values) if name.startswith(("levels", "depth")) else values
            for name, values in network.state_dict().items()
        }
    weights["decoder.6.bias"] = torch.tensor([0.5, 0.2, 1.0, -0.2])
    about = {"optics": fingerprint(fabric.optics()), "repeat": list(fabric.weave.repeat)}
    card = {
        "options": design.model_dump(mode="json", context=IDENTITY),
        "version": {"model": version},
        "fabrics": [about],
    }
    write_model(folder, safetensors.torch.save(weights), card)
    return str(folder)


@pytest.fixture(scope="session")
def neumip(tmp_path_factory):
    """The folder of a trained `neumip`: a repeat of odd sides at the coarser levels, channels that fill no element."""
    return neumip_folder(tmp_path_factory.mktemp("models") / "neumip", load_fabric(CLOTH), texels_per_yarn=5, hidden=18)


@pytest.fixture(scope="session")
def neumip_cpp(exported, neumip, tmp_path_factory):
    if lacking := missing("slangc", "g++"):
        pytest.skip(lacking)
    return compiled(exported(CLOTH, 2, "cpp", "glsles", model=neumip), tmp_path_factory.mktemp("neumip"))


def worst(found, expected):
    """Return the largest difference, as a share of the range of its column."""
    return (np.abs(found - expected) / np.ptp(expected, axis=0)).max()


def check_answers(found, expected, allowed):
    """Compare answers (N, 8), which are positive, with components at most their bounds."""
    assert worst(found, expected) < allowed
    assert (found >= 0.0).all() and (found[:, :4] <= found[:, 4:]).all()


@pytest.mark.parametrize(("kind", "allowed"), [("float32", ALLOWED["C++"]), ("float16", ALLOWED["16 bits"])])
@pytest.mark.parametrize("name", PRESETS)
def test_selvage_answers_its_golden_vectors(selvage_cpp, exported, read, name, kind, allowed):
    cloth = read(exported(name, model="selvage"), kind)
    check_answers(selvage_cpp(cloth.buffers, cloth.queries), cloth.answers[:, :8], allowed)


@pytest.mark.parametrize("name", PRESETS)
def test_golden_vectors_are_those_of_the_method(selvage, exported, read, name):
    """A network that changes nothing would pass all other tests with wrong weights."""
    cloth = read(exported(name, model="selvage"))
    soft = read(exported(name))
    assert (cloth.queries == soft.queries).mean() > 0.5
    same = (cloth.queries == soft.queries).all(axis=1)
    change = np.abs(cloth.answers[same, :4] - soft.answers[same, :4]) / np.ptp(soft.answers[:, :4], axis=0)
    assert np.median(change.max(axis=1)) > 1e-3
    size = sum(path.stat().st_size for path in exported(name, model="selvage").rglob("*") if path.is_file())
    assert size < 1_000_000


@pytest.mark.parametrize("name", UNSEEN)
def test_other_queries_of_selvage_are_answered(selvage, selvage_cpp, exported, read, name):
    """As for the soft nodes, at most 1 % of them hang on the last digit of a place."""
    fabric = load_fabric(name)
    queries = draw_queries(QueryOptions(stretch=8.0), fabric.weave.repeat, 12, 0, 2000)
    cloth = read(exported(name, model="selvage"))
    expected = selvage.predict(fabric, queries)
    found = selvage_cpp(cloth.buffers, rows_of(queries))
    differ = (np.abs(found[:, :4] - expected) / np.ptp(expected, axis=0)).max(axis=1) > ALLOWED["C++"]
    assert differ.mean() < 0.01


@pytest.mark.parametrize("name", UNSEEN)
def test_selvage_makes_no_light(selvage_cpp, exported, read, name):
    buffers, rng = read(exported(name, model="selvage")).buffers, np.random.default_rng(6)
    wi, solid = hemisphere(64)
    returned = []
    for deviation in (0.05, 0.4, 5.0):
        wo = hemisphere(8)[0][rng.integers(64)]
        fixed = np.tile((*rng.uniform(0.0, 8.0, 2), deviation, 0.7 * deviation, 0.3), (len(wi), 1))
        found = selvage_cpp(buffers, np.column_stack([fixed, wi, np.tile(wo, (len(wi), 1))]))
        returned.append(solid @ found[:, 2:4].sum(axis=1))
        # The rule has 64 x 64 directions: a kink of a clipped cosine costs it some 1e-3.
        assert returned[-1] <= solid @ found[:, 6:8].sum(axis=1) < 1.002
    assert min(returned[1:]) > 0.01  # a small footprint may see a gap


def test_light_and_viewer_behind_answer_nothing(selvage_cpp, neumip_cpp, neumip, exported, read):
    for answer, model in ((selvage_cpp, "selvage"), (neumip_cpp, neumip)):
        cloth = read(exported(CLOTH, model=model))
        rows = cloth.queries[:3].copy()
        rows[0, 7], rows[1, 10] = -rows[0, 7], -rows[1, 10]
        found = answer(cloth.buffers, rows)
        assert (found[:2] == 0.0).all() and (found[2] > 0.0).any()


@pytest.mark.parametrize("fabrics", [SOME, pytest.param(preset_names(), marks=pytest.mark.slow)], ids=["some", "all"])
@pytest.mark.parametrize(
    ("half", "allowed"),
    [(False, ALLOWED["browser"]), pytest.param(True, ALLOWED["16 bits"], marks=pytest.mark.slow)],
    ids=["float32", "float16"],
)
def test_networks_answer_in_a_browser(webgl, exported, read, neumip, half, allowed, fabrics):
    selvages = [read(exported(name, model="selvage")) for name in fabrics]
    folder = exported(CLOTH, 2, "cpp", "glsles", model="selvage")
    for cloth, found in zip(selvages, webgl(selvages, half, folder=folder), strict=True):
        check_answers(found, cloth.answers[:, :8], allowed)
    cloth = read(exported(CLOTH, model=neumip))
    (found,) = webgl([cloth], half, folder=exported(CLOTH, 2, "cpp", "glsles", model=neumip))
    check_answers(found, cloth.answers[:, :8], allowed)


@pytest.mark.parametrize(("kind", "allowed"), [("float32", ALLOWED["C++"]), ("float16", ALLOWED["16 bits"])])
def test_neumip_answers_its_golden_vectors(neumip_cpp, neumip, exported, read, kind, allowed):
    cloth = read(exported(CLOTH, model=neumip), kind)
    check_answers(neumip_cpp(cloth.buffers, cloth.queries), cloth.answers[:, :8], allowed)
    assert (cloth.answers[:, :4] > 0.0).mean() > 0.5 and np.ptp(cloth.answers, axis=0).min() > 0.05


def test_neumip_answers_beyond_its_repeat_and_its_levels(neumip_cpp, neumip, exported, read):
    fabric, cloth = load_fabric(CLOTH), read(exported(CLOTH, model=neumip))
    (method,) = load_model(model_folder(neumip, "test", "model"))
    queries = draw_queries(QueryOptions(sigma=(1e-3, 500.0)), fabric.weave.repeat, 4, 0, 1000)
    queries = queries._replace(u=queries.u - np.float32(64.0), v=queries.v + np.float32(32.0))
    expected = method.predict(fabric, queries)
    found = neumip_cpp(cloth.buffers, rows_of(queries))[:, :4]
    assert (np.abs(found - expected) / np.ptp(expected, axis=0)).max() < ALLOWED["C++"]


def forward(cloth, network, inputs):
    """Return outputs of a network as the descriptor says, before the last function."""
    buffer, values = cloth.said["buffers"]["weights"], cloth.buffers["weights"]

    def array(place):
        start = buffer["channels"] * place["offset"]
        return values[start : start + int(np.prod(place["shape"]))].reshape(place["shape"])

    layers = [layer for layer in cloth.said["network"]["layers"] if layer["network"] == network]
    x = np.pad(inputs, ((0, 0), (0, -inputs.shape[1] % 4)))
    for layer in layers:
        x = array(layer["biases"]) + x @ array(layer["weights"])
        if layer is not layers[-1]:
            x = np.where(x > 0.0, x, {"ReLU": 0.0, "leaky ReLU of slope 0.01": 0.01}[layer["activation"]] * x)
    return x


def test_the_descriptor_says_what_the_networks_compute(exported, read, selvage):
    cloth, fabric = read(exported("denim", model="selvage")), load_fabric("denim")
    queries = draw_queries(QueryOptions(), fabric.weave.repeat, 5, 0, 500)
    found = read_queries(tabulate(fabric), queries)
    assert len(cloth.said["network"]["inputs"]["correction"]) == OF_QUERY
    factors = 2.0 / (1.0 + np.exp(-forward(cloth, "correction", found.features[:, :OF_QUERY])))
    answer = np.minimum(factors * found.components, found.bounds)
    np.testing.assert_allclose(answer, selvage.predict(fabric, queries), rtol=1e-4, atol=1e-6)


def session(folder):
    return onnxruntime.InferenceSession(folder / "onnx" / "network.onnx", providers=["CPUExecutionProvider"])


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
        said = json.loads(next(path for path in folder.glob("*.json") if path.name != "golden.json").read_text())
        assert said["languages"] == {"onnx": ["onnx/network.onnx"]} and set(said["network"]["onnx"]) == set(inputs)
        (answer,) = session(folder).run(None, inputs)
        expected = method.predict(fabric, queries)
        assert worst(answer, expected) < ALLOWED["ONNX"]
