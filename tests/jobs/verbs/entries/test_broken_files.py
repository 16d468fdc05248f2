import shutil

import pytest

from jobs.recipe.load import load_recipe
from tests.jobs.test_bad_inputs import KINDS
from tests.refusals import ends, refusal


@pytest.mark.parametrize("name", ["entry.toml", "answers.parquet", "answers.csv"])
def test_a_broken_file_of_an_entry_is_one_sentence(name, recipe, entry):
    for kind, write in KINDS.items():
        folder = entry()
        if name == "answers.csv":
            (folder / "answers.parquet").unlink()
        (folder / name).unlink(missing_ok=True)
        write(folder / name)
        with ends():
            assert folder.name in refusal(load_recipe, recipe, [str(folder / "entry.toml")]), kind
        shutil.rmtree(folder)
