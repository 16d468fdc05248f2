import json

import numpy as np
import pytest
import torch

from pipeline.models.added.guarded import MethodFailed
from pipeline.models.added.network import build_added, restore_added
from pipeline.models.network import Batch
from tests.pipeline.models.stand_ins import card_of, written
from tests.pipeline.truth.cloths import equal_queries, woven
from weaves.fabric import load_fabric

CLOTHS = load_fabric("denim"), load_fabric("cotton_twill")

NETWORK = """
class Network(nn.Module):
    def __init__(self, fabrics):
        super().__init__()
        self.answer = nn.Parameter(torch.ones(4))

    def forward(self, queries):
        return self.answer.repeat(len(queries.u), 1)

    def loss(self, batch, random):
        return (torch.rand(()) * self.answer - batch.target).square().mean()

"""


@pytest.fixture
def theirs(tmp_path):
    return written(tmp_path, NETWORK)


def batch():
    columns = {name: torch.ones(2, 3) for name in Batch._fields}
    columns |= {"fabric": torch.arange(2), "target": torch.full((2, 3, 4), 0.5)}
    return Batch(**columns | {name: torch.ones(2, 3, 3) for name in ("wi", "wo")})


def trained(network, cloths, answer):
    fabrics = [about for cloth in cloths for about in card_of(cloth)["fabrics"]]
    card = {"architecture": network.architecture(), "fabrics": fabrics}
    return json.loads(json.dumps(card)), {"network.answer": torch.full((4,), float(answer))}


def test_functions_that_are_missing_have_defaults_and_random_numbers_are_those_of_the_step(theirs):
    network = build_added(theirs(), CLOTHS)
    network.start_at(torch.ones(5, 4))
    network.schedule(0.5)
    (group,) = network.parameter_groups(0.25)
    assert group["lr"] == 0.25 and group["params"][0] is network.network.answer
    about = network.architecture()
    assert (about["parameters"], about["layers"]) == ({"total": 4}, {"answer": [4]})
    losses = [network.loss(batch(), np.random.default_rng(seed)).item() for seed in (1, 2, 1)]
    assert losses[0] == losses[2] != losses[1]


def test_its_own_functions_are_used(theirs):
    own = """
    def start_at(self, target):
        self.answer.data = target.mean(dim=0)

    def schedule(self, progress):
        self.answer.data = self.answer.data * progress

    def parameter_groups(self, rate):
        return [{"params": [self.answer], "lr": rate / 2}]

    def architecture(self):
        return {"note": "tiny"}

    def loss"""
    network = build_added(theirs("    def loss", own), CLOTHS)
    network.start_at(torch.tensor([[1.0, 2, 3, 4], [3, 4, 5, 6]]))
    network.schedule(0.5)
    assert network.network.answer.tolist() == [1.0, 1.5, 2.0, 2.5]
    assert network.parameter_groups(1.0)[0]["lr"] == 0.5
    assert network.architecture()["note"] == "tiny"


LOSS = "(torch.rand(()) * self.answer - batch.target).square().mean()"


def own_function(head, body):
    return "    def loss", f"    def {head}:\n        {body}\n\n    def loss"


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (("return Network(fabrics)", "return 5"), "network returned int; a torch.nn.Module is needed"),
        (("return Network(fabrics)", "raise KeyError('x')"), "network: KeyError: 'x' (theirs.py, line 36)"),
        (("def loss", "def los"), "network returned Network, which lacks the function 'loss'"),
        (("nn.Parameter(torch.ones(4))", "torch.ones(4)"), "network returned Network, which has nothing to train"),
        ((LOSS, "5.0"), "loss returned float; a tensor with one number is needed"),
        ((LOSS, "self.answer[:1]"), "loss returned a tensor float32 (1,); one number, shape (), is needed"),
        ((LOSS, "self.answer.detach().sum()"), "loss returned a number that does not depend on the network's param"),
        (own_function("start_at(self, target)", "raise ValueError('no')"), "start_at: ValueError: no"),
        (own_function("parameter_groups(self, rate)", "return [{'lr': rate}]"), "parameter_groups: KeyError: 'params'"),
        (own_function("architecture(self)", "return {'a': torch.ones(1)}"), "architecture: TypeError"),
        (("self.trained = network", "raise OSError('full')"), "load: OSError: full"),
        (("torch.ones(4)", "torch.ones(5)"), "network: RuntimeError: Error(s) in loading state_dict"),
    ],
)
def test_a_fault_is_a_sentence_with_the_name_of_the_function(theirs, change, sentence):
    part = trained(build_added(theirs(), CLOTHS), CLOTHS, 1)
    options = theirs(*change)
    with pytest.raises(MethodFailed) as failure:
        network = build_added(options, CLOTHS)
        network.start_at(torch.ones(1, 4))
        network.schedule(0.0)
        network.parameter_groups(0.1)
        network.architecture()
        if "torch.ones(5)" not in change:
            network.loss(batch(), np.random.default_rng(0))
        restore_added(options, [part])
    assert str(failure.value).startswith(f"theirs: {sentence}")


def test_weights_are_loaded_and_fabrics_come_back_from_the_card_each_to_its_network(theirs):
    options = theirs()
    network = build_added(options, CLOTHS)
    method = restore_added(options, [trained(network, CLOTHS, 3)])
    assert not method.method.trained.training
    assert method.predict(CLOTHS[0], equal_queries([0, 0, 1], [0, 0, 1], rows=2)).tolist() == [[3.0] * 4] * 2
    assert (method.name, method.domain, method.bytes_stored(CLOTHS[0])) == ("theirs", None, 16)
    options = theirs("super().__init__()", "super().__init__(); self.seen = fabrics")
    network = build_added(options, CLOTHS)
    assert [cloth.optics() for cloth in network.network.seen] == [cloth.optics() for cloth in CLOTHS]
    assert network.network.seen[0].warp.diffuse != CLOTHS[0].warp.diffuse
    method = restore_added(options, [trained(network, CLOTHS, 3)])
    assert method.method.trained.seen == network.network.seen
    options = theirs(has_one_fabric=True)
    parts = [trained(build_added(options, [cloth]), [cloth], index + 1) for index, cloth in enumerate(CLOTHS)]
    method = restore_added(options, parts)
    for index, cloth in enumerate(CLOTHS):
        for dyed in (cloth, woven(cloth.name, warp={"diffuse": (0.0, 0.0, 0.5)})):
            assert method.covers(dyed)
            assert method.predict(dyed, equal_queries([0, 0, 1], [0, 0, 1])).tolist() == [[index + 1.0] * 4]
    assert not method.covers(load_fabric("polyester_lining"))
