from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
import pytest
import torch
from torch import nn

from pipeline.fingerprint import fingerprint
from pipeline.models import runtimes
from pipeline.models.analytic.soft_nodes import SoftNodes
from pipeline.models.method import CHUNK_ROWS, refuse_other
from pipeline.models.network import Answering, PerQuery, one_thread
from pipeline.models.neumip import NeumipOptions
from pipeline.models.neumip.model import Neumip, NeumipNetwork
from pipeline.models.runtimes import RUNTIME_TOLERANCE, RUNTIMES, RunBy, Runtime, not_run, runs
from pipeline.models.woven.model import Woven, WovenNetwork
from pipeline.shards.queries import QueryOptions, draw_queries
from tests.pipeline.models.stand_ins import SMALL, FakeMethod
from weaves.errors import BadInput, WorkFailed
from weaves.fabric import load_fabric

FABRICS = [load_fabric("denim"), load_fabric("silk_charmeuse")]
DENIM = FABRICS[0]
NEAR_ONE = 1 + 2.0**-9  # rounds to 1 in bfloat16, and is exact in float16


class Linear(FakeMethod):
    """A method of one product of matrices: u, v, sigma times a matrix, plus a number of the fabric."""

    name = "linear"

    def __init__(self, weight, constant=0.0):
        self.layer = nn.Linear(3, 4, bias=False)
        self.layer.weight = nn.Parameter(torch.tensor(weight, dtype=torch.float32))
        self.constant = torch.full((1, 4), constant)
        self.module = Answering(self.layer, lambda u, v, sigma, add: self.layer(torch.stack([u, v, sigma], -1)) + add)

    def predict(self, fabric, queries, seed=0):
        columns = np.stack([queries.u, queries.v, queries.sigma], axis=-1)
        return columns @ self.layer.weight.detach().numpy().T + self.constant.numpy()

    def per_query(self, fabric):
        refuse = partial(refuse_other, who="the method answers", kinds=("stretch",))
        return PerQuery(refuse, lambda q: (q.u, q.v, q.sigma), self.module, (self.constant,))


def asked(rows=50, **options):
    return draw_queries(QueryOptions(**options), DENIM.weave.repeat, 3, 0, rows)


@pytest.mark.parametrize(("runtime", "answer"), [("eager-bf16", 1.0), ("eager-fp16", NEAR_ONE)])
def test_half_precision_rounds_the_products_as_its_format_says(runtime, answer):
    run = RunBy(Linear(NEAR_ONE * np.eye(4, 3), constant=1e-6), runtime)
    run.prepare(DENIM)
    ones = np.ones(5, np.float32)
    found = run.predict(DENIM, asked(5)._replace(u=ones, v=ones, sigma=ones))
    # What is added afterwards is added in single precision.
    np.testing.assert_allclose(found[:, :3], np.float32(answer) + np.float32(1e-6), rtol=1e-7)


def test_any_number_of_rows_in_their_order():
    method = Linear(np.arange(12).reshape(4, 3))
    run = RunBy(method, "onnx")
    run.prepare(DENIM)
    for rows in (0, 1, 50, CHUNK_ROWS + 3):
        queries = asked(CHUNK_ROWS + 3).take(slice(rows))
        found = run.predict(DENIM, queries)
        assert found.shape == (rows, 4) and found.dtype == np.float32
        np.testing.assert_allclose(found, method.predict(DENIM, queries), rtol=2e-3, atol=2e-2)


def test_onnx_agrees_in_single_precision_and_fabrics_share_one_module(monkeypatch):
    loads = []
    plain = RUNTIMES["onnx"]
    monkeypatch.setitem(RUNTIMES, "onnx", plain._replace(load=lambda *x: loads.append(x) or plain.load(*x)))
    woven = Woven(WovenNetwork(SMALL["woven"]))
    run = RunBy(woven, "onnx")
    assert (run.name, run.setting) == ("woven", "onnx")
    for fabric in FABRICS:
        run.prepare(fabric)
        queries = draw_queries(QueryOptions(), fabric.weave.repeat, 5, 0, 200)
        own = woven.predict(fabric, queries)
        assert np.linalg.norm(run.predict(fabric, queries) - own) <= RUNTIME_TOLERANCE * np.linalg.norm(own)
        assert run.bytes_stored(fabric) == woven.bytes_stored(fabric)
    assert len(loads) == 1


@pytest.mark.slow
def test_eight_bits_cost_a_percent_and_save_three_bytes_of_four():
    options = NeumipOptions(texels_per_yarn=2, hidden=128)
    neumip = Neumip({fingerprint(DENIM.optics()): NeumipNetwork(options, DENIM.weave.repeat)})
    run, queries = RunBy(neumip, "onnx-int8"), asked(500)
    run.prepare(DENIM)
    assert not run.covers(FABRICS[1])
    own, found = neumip.predict(DENIM, queries), run.predict(DENIM, queries)
    # Five products in a row, each rounding weights and activations by up to 1/255 of their range.
    assert 1e-4 < np.linalg.norm(found - own) / np.linalg.norm(own) < 0.1
    network = neumip.network_of(DENIM)
    weights = sum(w.numel() for part in (network.decoder, network.offset) for w in part.parameters() if w.ndim == 2)
    saved = neumip.bytes_stored(DENIM) - run.bytes_stored(DENIM)
    assert saved == pytest.approx(3 * weights, rel=0.1)


@pytest.mark.slow
def test_torch_compiles_a_module_once_and_any_thread_may_call_it():
    if reason := RUNTIMES["compile"].missing():
        pytest.skip(reason)
    method = Linear(np.arange(12).reshape(4, 3), constant=2.0)
    run = RunBy(method, "compile")
    several = [asked(rows) for rows in (1, 50, 600)]
    with ThreadPoolExecutor(2) as pool:
        pool.submit(run.prepare, DENIM).result()
        compiled = torch._dynamo.utils.counters["stats"]["unique_graphs"]
        with one_thread():
            run.predict(DENIM, asked(50))
        assert torch._dynamo.utils.counters["stats"]["unique_graphs"] == compiled > 0
        found = list(pool.map(lambda queries: run.predict(DENIM, queries), several))
    for queries, answers in zip(several, found, strict=True):
        np.testing.assert_allclose(answers, method.predict(DENIM, queries), rtol=1e-5, atol=1e-5)


def test_answers_of_its_own_and_what_was_not_taught_are_refused(monkeypatch):
    wrong = Runtime(lambda: "", lambda module, *_: runtimes._Program(lambda *given: 1.001 * module(*given)))
    monkeypatch.setitem(RUNTIMES, "onnx", wrong)
    with pytest.raises(WorkFailed, match=r"linear by onnx on denim: answers differ .* by 1\.0e-03, beyond 0\.0001"):
        RunBy(Linear(np.eye(4, 3)), "onnx").prepare(DENIM)
    with pytest.raises(BadInput, match="viewer's side only"):
        RunBy(Linear(np.eye(4, 3)), "eager-bf16").predict(DENIM, asked(50, behind=1.0))


def test_what_the_machine_lacks_is_left_out_with_its_reason(monkeypatch):
    monkeypatch.setitem(RUNTIMES, "compile", Runtime(lambda: "no compiler", RUNTIMES["compile"].load))
    names, method = ["eager-bf16", "compile"], Linear(np.eye(4, 3))
    assert [run.setting for run in runs(method, names)] == ["eager-bf16"]
    assert not_run(method, names) == {"compile": "no compiler"}
    assert not runs(SoftNodes(), names) and not not_run(SoftNodes(), names)
    monkeypatch.setattr(runtimes.importlib.util, "find_spec", lambda name: None if name == "onnxscript" else object())
    assert RUNTIMES["onnx"].missing() == "not installed: onnxscript"
