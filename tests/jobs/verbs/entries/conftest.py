import tomllib

import numpy as np
import pytest
import tomli_w

from jobs.recipe.entry import FORM, blank_form
from jobs.recipe.load import load_recipe
from pipeline.shards.entry_files import write_answers
from tests.jobs import made_up

FILLED = {
    "authors": "Ada Weaver", "version": "3f2a", "source": "", "nanoseconds": 120.0, "threads": 2,
    "machine": "an old laptop", "bytes_stored": 5000, "multiply_adds": 900, "training": "none", "tries": 1,
}  # fmt: skip


def write_recipe(folder):
    """Write a recipe of a seen, an unseen and two random fabrics, each with 64 held-out queries."""
    random = {"count": 2, "seed": 5}
    return made_up.write_recipe(folder, "tiny", "prefiltered", unseen=["voile"], unseen_population=random)


@pytest.fixture
def recipe(tmp_path):
    return write_recipe(tmp_path)


@pytest.fixture
def entry(tmp_path, recipe):
    """Return a function that writes an entry of the recipe from its blank form, and returns the folder."""
    loaded = load_recipe(recipe)
    blank = tomllib.loads(blank_form(loaded.questions))

    def entry(answers=None, name="theirs", **form):
        folder = tmp_path / name
        folder.mkdir(exist_ok=True)
        (folder / FORM).write_text(tomli_w.dumps(blank | FILLED | {"name": name} | form), encoding="utf-8")
        count = 64 * len(loaded.tested)
        write_answers(folder / "answers.parquet", np.full((count, 4), 0.1, np.float32) if answers is None else answers)
        return folder

    return entry
