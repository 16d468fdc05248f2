"""Stand-ins for trained methods: one of this package, and one from outside as the text of its file."""

import numpy as np

from pipeline.models.added.added_code import AddedMethod
from pipeline.models.added.source import locate


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
        return AddedMethod(
            name="theirs", source=source.text, sha256=source.sha256(), stated="1", has_network=True, **fields
        )

    return options
