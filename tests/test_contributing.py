"""The recipes of CONTRIBUTING.md, each followed to the letter in a copy of the tree."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
ROOMS = ("weaves", "pipeline", "reports", "jobs")
TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
SECTIONS = dict(re.findall(r"^### (.+?)\n(.*?)(?=^##|\Z)", TEXT, re.M | re.S))

CHECKS = {
    "A weave": """
from weaves.draft import cells
from weaves.fabric import load_fabric, preset_names
assert "sacking" in preset_names()
draft = load_fabric("sacking").weave
assert draft.repeat == (4, 8)
assert set(cells(draft).top_length.ravel().tolist()) == {2.0, 4.0}
""",
    "An estimator": """
import numpy as np
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from weaves.fabric import load_fabric
u = np.zeros(3, np.float32)
up = np.tile(np.float32([0, 0, 1]), (3, 1))
answers = estimate(load_fabric("denim"), Queries.round(u, u, u + 1, up, up), TruthOptions(estimator="paper"), 0)
assert np.allclose(answers.mean.sum(axis=1), 1 / np.pi)
assert answers.standard_error.max() == 0
""",
    "A model": """
import numpy as np
from jobs.plan.plan import plan
from jobs.recipe.load import load_recipe
from pathlib import Path
from pipeline.models.catalogue import CLASSES
from pipeline.models.method import Method
from pipeline.models.registry import load_methods
from pipeline.truth.query import Queries
from weaves.fabric import load_fabric
(method,) = load_methods(CLASSES["matt"](albedo=0.25))
assert isinstance(method, Method)
u = np.zeros(2, np.float32)
up = np.tile(np.float32([0, 0, 1]), (2, 1))
answers = method.predict(load_fabric("denim"), Queries.round(u, u, u + 1, up, up))
assert np.allclose(answers.sum(axis=1), 0.25 / np.pi)
text = Path("jobs/recipes/smoke.toml").read_text()
Path("my.toml").write_text(text.replace("[bench]", '[[models]]\\nmodel = "matt"\\n\\n[bench]', 1))
assert any("matt" in task.title for task in plan(load_recipe("my.toml")))
""",
    "A metric": """
import numpy as np
from pipeline.truth.query import Answers, Queries
from reports.measure import held_out
from reports.record import to_table
from reports.tables.page_tables import page_frames, result_tables
from weaves.fabric import load_fabric
u = np.zeros(3, np.float32)
up = np.tile(np.float32([0, 0, 1]), (3, 1))
answers = Answers.opaque(np.full((3, 4), 0.1, np.float32), np.full((3, 4), 1e-3, np.float32), np.ones(3, np.int32))
rows = held_out.HeldOutFabric(load_fabric("denim"), Queries.round(u, u, u + 1, up, up), answers)
class Method:
    name, setting = "off", ""
    def prepare(self, fabric): ...
    def predict(self, fabric, queries, seed=0):
        return answers.mean + np.float32([[0], [0], [0.25]])
records = [one.model_copy(update={"role": "seen"}) for one in held_out.measure_errors(Method(), rows, 0)]
(found,) = [record for record in records if record.metric == "largest_error"]
assert abs(found.value - 0.25) < 1e-6 and found.unit == "1/sr"
assert "largest_error" in set(to_table(records)["metric"])
frames = page_frames(records)
assert abs(frames["errors"]["largest_error"][0] - 0.25) < 1e-6
table = result_tables(records, frames, {})["error"][0]
titles = [title.replace("\\xa0", " ") for title in table.columns[1:]]
assert table.rows[0].cells[titles.index("largest error")].text == ".250"
""",
    "A scene": """
from pipeline.scenes.catalogue import load_scene
from pipeline.scenes.frame import render
from pipeline.scenes.loading import load
frame = render(load(load_scene("wall")), size=(16, 16))
assert frame.gbuffers["denim"].mask.any()
""",
}


def followed(section, folder):
    """Write the files of a section into a copy of the tree and make its changes; return the files that it names."""
    blocks = re.findall(r"^`(\S+)`:\n\n```(\w+)\n(.*?)^```$", section, re.M | re.S)
    assert len(blocks) == section.count("\n```\n"), "a block lacks the line with its file"
    for name, kind, content in blocks:
        path = folder / name
        if kind != "diff":
            assert not path.exists(), f"{name} exists already"
            path.parent.mkdir(exist_ok=True)
            path.write_text(content, encoding="utf-8")
            continue
        path.write_text(changed(path.read_text(encoding="utf-8"), content, name), encoding="utf-8")
    return [name for name, *_ in blocks]


def changed(text, diff, name):
    """Apply lines of a diff: `+` takes the place of the `-` before it, or follows the line before it.

    A part of a line may stand for it, if it is not a whole line."""
    for old, new in re.findall(r"^([- ].*)\n((?:\+.*\n?)*)", diff, re.M):
        assert new, f"{name}: {old!r} changes nothing: a line with + is needed after it"
        whole = re.compile(f"^{re.escape(old[1:])}$", re.M)
        place = whole if whole.search(text) else re.compile(re.escape(old[1:]))
        assert len(place.findall(text)) == 1, f"{name}: {old[1:]!r} is there {len(place.findall(text))} times"
        lines = [] if old.startswith("-") else [old[1:]]
        added = "\n".join([*lines, *(line[1:] for line in new.splitlines())])
        text = place.sub(lambda _, added=added: added, text)
    return text


def test_every_recipe_is_tried():
    recipes = TEXT.partition("## Recipes for common changes")[2].partition("\n## ")[0]
    assert re.findall(r"^### (.+)$", recipes, re.M) == list(CHECKS)


def test_every_recipe_works_as_it_is_written(tmp_path):
    """All of them in one copy of the tree, and their checks in one process."""
    for room in ROOMS:
        shutil.copytree(ROOT / room, tmp_path / room, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    files = [file for name in CHECKS for file in followed(SECTIONS[name], tmp_path)]
    checks = "".join(f"print({name!r}, flush=True)\n{check}" for name, check in CHECKS.items())
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    for command in (["-c", checks], ["-m", "ruff", "check", "--no-cache", *(f for f in files if f.endswith(".py"))]):
        done = subprocess.run([sys.executable, *command], cwd=tmp_path, env=environment, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
