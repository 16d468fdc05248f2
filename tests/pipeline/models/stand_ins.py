"""Stand-ins for trained methods: networks of few weights, a method, and one from outside as the text of its file."""

import numpy as np
import torch

from pipeline.fingerprint import fingerprint
from pipeline.models.added.added_code import AddedMethod
from pipeline.models.added.source import locate
from pipeline.models.curved import CurvedOptions
from pipeline.models.network import Batch
from pipeline.models.neumip import HierarchicalOptions, NeumipOptions, TriplePlaneOptions
from pipeline.models.registry import build_network
from pipeline.models.unified_btf import BtfAutoencoderOptions, UnifiedBtfOptions, UniversalOptions
from pipeline.models.woven import WovenOptions

_SAMPLES = {"texels_per_yarn": 2, "samples": 8, "hidden": 16}
_BTF = {**_SAMPLES, "fewest_samples": 4, "weights": 8}

SMALL = {
    "woven": WovenOptions(map_texels=16, encoder_channels=4),
    "neumip": NeumipOptions(texels_per_yarn=4),
    "triple_plane": TriplePlaneOptions(texels_per_yarn=4, direction_texels=4),
    "hierarchical": HierarchicalOptions(texels_per_yarn=4),
    "curved": CurvedOptions(texels_per_yarn=4, silhouette_rows=512, silhouette_sigma=(0.5, 8.0)),
    "unified_btf": UnifiedBtfOptions(**_BTF),
    "btf_autoencoder": BtfAutoencoderOptions(**_BTF),
    "universal": UniversalOptions(**_SAMPLES, latent=4, steps=8),
}
"""A small design of every network."""


def untrained(options, *fabrics):
    """Return an untrained network for these fabrics, with the extra rows that it learns from."""
    extra = [[rows.answer(fabric, 0, rows.count(fabric)) for fabric in fabrics] for rows in options.extra_rows]
    return build_network(options, fabrics, extra)


def card_of(fabric, domain=None):
    about = {"name": fabric.name, "optics": fingerprint(fabric.optics()), "repeat": list(fabric.weave.repeat)}
    return {"fabrics": [about]} | ({} if domain is None else {"domain": domain.model_dump(mode="json")})


def batch_of(queries, target, fabric=0):
    """Return a step of a training with queries about one fabric; no light passes it unscattered."""
    columns = {name: torch.from_numpy(np.array(column))[None] for name, column in queries._asdict().items()}
    through = torch.zeros(1, len(queries.u))
    return Batch(torch.tensor([fabric]), **columns, target=torch.as_tensor(target)[None], transparency=through)


def descend(optimiser, steps, loss):
    """Take steps of an optimiser down a loss, a function of the step; return the losses."""
    losses = []
    for step in range(steps):
        value = loss(step)
        optimiser.zero_grad()
        value.backward()
        optimiser.step()
        losses.append(value.item())
    return losses


class FakeMethod:
    """Answers as a test says, 1 if it says nothing, and remembers what it was asked."""

    name, setting = "fake", ""

    def __init__(self, answers=lambda queries: np.ones((len(queries.u), 4), np.float32)):
        self.answers, self.asked = answers, []

    def covers(self, fabric):
        return True

    def prepare(self, fabric):
        pass

    def predict(self, fabric, queries, seed=0):
        self.asked.append(queries)
        return self.answers(queries)

    def bytes_stored(self, fabric):
        return 48


METHOD = """
class Theirs:
    name, version, setting, kinds = "theirs", "2.1", "", {"stretch"}

    def __init__(self, rows=8):
        assert rows < 100, "too many rows"

    def covers(self, fabric):
        return True

    def prepare(self, fabric):
        pass

    def predict(self, fabric, queries, seed=0):
        with torch.inference_mode():
            return self.trained(queries._make(map(torch.tensor, queries))).numpy()

    def bytes_stored(self, fabric):
        return 16
"""

TRAINED = """
    def network(self, fabrics):
        return Network(fabrics)

    def load(self, network):
        self.trained = network
"""


def written(folder, network):
    """Return a function that writes a method with a network, a part of the text replaced, and returns its options."""
    text, path = f"import torch\nfrom torch import nn\n{network}{METHOD}{TRAINED}", folder / "theirs.py"

    def options(old="", new="", **fields):
        assert old in text
        path.write_text(text.replace(old, new))
        source = locate(f"{path}:Theirs")
        facts = {"name": "theirs", "source": source.text, "sha256": source.sha256(), "stated": "1"}
        return AddedMethod(**facts, has_network=True, **fields)

    return options
