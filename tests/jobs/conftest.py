from functools import partial

import pytest

from jobs.cli import main
from jobs.plan.plan import plan
from jobs.recipe.load import load_recipe
from jobs.run.executor import execute
from jobs.verbs import run
from tests.jobs import fake_stages

RECIPE = """
name = "tiny"

[dataset]
seen = ["denim", "own.toml"]
unseen = ["twill_4_4"]
shard_rows = 1000
seed = 3

[dataset.rows]
train = 2500
population = 800
validation = 100
test = 500

[dataset.population]
count = 3
exclude = ["twill 4/4"]

[dataset.queries]
sigma = [0.05, 8.0]

[dataset.truth]
relative_error = 0.05

[[models]]
model = "woven"
hidden = 32
[models.training]
steps = 10

[[models]]
model = "neumip"

[[models]]
model = "point_sampled"
counts = [1, 2]

[bench]
frames = 4
"""

FABRIC = """
name = "own"
source = "made up"
draft = { family = "satin", ends = 5, move = 2 }
warp = { bend = 20.0, roughness = 0.3, diffuse = "#804020" }
weft = { bend = 30.0, roughness = 0.4 }
"""


class Files:
    """A recipe and a fabric of its own in a folder; text may be exchanged before they are read."""

    recipe = RECIPE
    plans = {}  # noqa: RUF012, of all tests: equal files are planned once

    def __init__(self, folder):
        self.folder = folder
        self.path = folder / "tiny.toml"
        self.text, self.fabric = RECIPE, FABRIC

    def write(self):
        (self.folder / "own.toml").write_text(self.fabric, encoding="utf-8")
        self.path.write_text(self.text, encoding="utf-8")
        return str(self.path)

    def exchange(self, old, new):
        """Replace text that occurs once in one of the two files."""
        assert self.text.count(old) + self.fabric.count(old) == 1, old
        self.text, self.fabric = self.text.replace(old, new), self.fabric.replace(old, new)
        return self

    def plan(self):
        """Return the tasks of the recipe, which nobody changes."""
        key = self.text, self.fabric
        if key not in self.plans:
            self.plans[key] = plan(load_recipe(self.write()))
        return self.plans[key]


@pytest.fixture
def files(tmp_path):
    return Files(tmp_path)


@pytest.fixture
def twillight(capsys, monkeypatch, tmp_path):
    """Run the command line in a folder of its own; return exit code, output and complaint."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setattr("jobs.cli.app._fallback_console", None)  # it keeps the width at its first use

    def call(*tokens):
        capsys.readouterr()
        code = main([*map(str, tokens)])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return call


@pytest.fixture
def here(monkeypatch):
    """Runs without a cluster: task after task in this process, as a part does them."""
    for module in (fake_stages, run):
        monkeypatch.setattr(module, "execute", partial(execute, serial=True))
