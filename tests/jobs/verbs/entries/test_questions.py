import json
import tomllib

import numpy as np
import pyarrow.parquet as pq
import pytest
from pyarrow import csv

from jobs.recipe.entry import FORM, EntryForm
from jobs.recipe.load import load_recipe
from pipeline.fingerprint import file_sha256
from pipeline.shards.generate import ShardTask, generate_shard
from pipeline.shards.schema import QUERY_COLUMNS, SCHEMA
from pipeline.shards.store import numbers_of, read_table
from pipeline.truth.options import TruthOptions
from reports.images.exr import read_exr
from tests.jobs import made_up
from weaves.draft_files.read import read_draft
from weaves.errors import BadInput
from weaves.fabric import load_fabric
from weaves.surface import surface_at
from weaves.validation import validated
from weaves.yarn import Yarn


@pytest.fixture
def folder(call, recipe, tmp_path):
    code, said, _ = call("questions", recipe, "--to", tmp_path / "q")
    assert code == 0 and "256 questions about 4 fabrics" in said
    return tmp_path / "q"


def test_the_questions_are_those_of_the_shards_without_their_answers(folder, recipe, tmp_path):
    table = pq.read_table(folder / "questions.parquet")
    assert table.column_names == ["id", "fabric", *QUERY_COLUMNS]
    assert all(table.schema.field(name).metadata for name in table.column_names)
    text = csv.read_csv(folder / "questions.csv")
    for name in ("id", *QUERY_COLUMNS):
        np.testing.assert_array_equal(text[name].to_numpy().astype(table[name].to_numpy().dtype), table[name])
    assert text["fabric"].to_pylist() == table["fabric"].to_pylist()
    assert set(text.column_names).isdisjoint(SCHEMA.names[13:])
    listed = json.loads((folder / "questions.json").read_text())
    dataset = load_recipe(recipe).dataset
    coarse = TruthOptions(estimator="mc", relative_error=1, min_count=64, max_count=64)
    voile = listed["fabrics"][1]
    assert (voile["name"], voile["role"], voile["first_id"], voile["last_id"]) == ("voile", "unseen", 64, 127)
    task = ShardTask(fabric=load_fabric("voile"), start=0, rows=64, split="test", seed=dataset.seed, truth=coarse)
    generate_shard(task, tmp_path / "shard.parquet")
    drawn = numbers_of(read_table(tmp_path / "shard.parquet"))
    for name in QUERY_COLUMNS:
        np.testing.assert_array_equal(table[name].to_numpy()[64:128], drawn[name])


def test_a_folder_has_all_that_is_known_of_the_fabrics_a_form_to_be_filled_in_and_no_other_file(folder):
    names = {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}
    listed = json.loads((folder / "questions.json").read_text())
    assert names == listed["files"].keys() | {"questions.json"}
    assert all(file_sha256(folder / name) == sha for name, sha in listed["files"].items() if name != "questions.json")
    for about in listed["fabrics"]:
        fabric = load_fabric(folder / "fabrics" / f"{about['name']}.toml")
        assert fabric.weave.rows() == about["drawdown"] and [*fabric.weave.repeat] == about["repeat"]
        assert len(read_draft(folder / "fabrics" / f"{about['name']}.wif").ends.colours) % fabric.weave.repeat[0] == 0
        height = read_exr(folder / "fabrics" / f"{about['name']}.exr").channels["height"][::-1]
        assert height.shape == tuple(16 * n for n in fabric.weave.repeat[::-1])
        place = surface_at(fabric, np.array([2.5 / 16]), np.array([17.5 / 16]))
        assert height[17, 2] == pytest.approx(place.height[0], abs=1e-6)
        colours = [fabric.warp.specular_rgb, fabric.weft.specular_rgb, fabric.warp.diffuse_rgb, fabric.weft.diffuse_rgb]
        np.testing.assert_allclose(about["colours"], colours, atol=1e-8)
    words = (folder / "README.md").read_text(encoding="utf-8")
    assert "f_P ALREADY CONTAINS" in words.replace("`", "") and "Ids are 0 to 255" in words
    assert all(f"`{key}`" in words for key in Yarn.model_fields) and "{" not in words
    text = (folder / FORM).read_text(encoding="utf-8")
    blank = tomllib.loads(text)
    assert blank.keys() == EntryForm.model_fields.keys() and text.count("\n# ") >= len(blank)
    with pytest.raises(BadInput, match=r"name.*one of"):
        validated(EntryForm, blank, FORM)


def test_the_same_recipe_gives_the_same_bytes_and_a_changed_file_is_refused(folder, recipe, refused, call):
    before = made_up.contents(folder)
    assert call("questions", recipe, "--to", folder)[0] == 0 and made_up.contents(folder) == before
    (folder / "questions.csv").write_text("id\n")
    assert "was changed" in refused("questions", recipe, "--to", folder)
