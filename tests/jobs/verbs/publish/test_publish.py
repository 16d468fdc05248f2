import hashlib
import json
import shutil
import subprocess
import sys
from collections import Counter

import duckdb
import mlcroissant
import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
import yaml

import twillight
from jobs.cli import main
from jobs.plan.dataset import DataSet
from jobs.recipe.load import load_recipe
from jobs.verbs.publish import publish as verb
from pipeline.fingerprint import file_sha256
from pipeline.shards.manifest import Manifest
from pipeline.shards.schema import SCHEMA
from tests.jobs import made_up
from tests.refusals import refusal
from weaves.fabric import load_fabric

OPTIONS = {
    "seen": ["denim", "own.toml"],
    "unseen": ["twill_4_4"],
    "rows": {"train": 160, "population": 96, "validation": 32, "test": 64},
    "population": {"count": 3, "exclude": ["twill 4/4"]},
    "unseen_population": {"count": 2, "families": ["irregular", "large_satin"], "balanced": True},
}
ROWS = {("seen", "train"): 320, ("seen", "validation"): 64, ("seen", "test"): 128, ("population", "train"): 288}
ROWS |= {("unseen", "test"): 64, ("unseen_population", "test"): 128}


def write_dataset(folder, *more):
    """Write the shards of the recipe, with made-up answers, and return the folder of the data set."""
    folder.mkdir(exist_ok=True)
    own = load_fabric("satin_8").model_copy(update={"name": "own"}).to_toml()
    (folder / "own.toml").write_text(own, encoding="utf-8")
    recipe = made_up.write_recipe(folder, "wide", "woven", *more, **OPTIONS)
    made_up.finished(recipe, folder / "out", ["generate"])
    return folder / "out" / DataSet(load_recipe(recipe)).folder


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    return write_dataset(tmp_path_factory.mktemp("made"))


def publish(folder, target, *more, licence="CC-BY-4.0"):
    return main(["publish", str(folder), "--to", str(target), "--licence", licence, *more])


@pytest.fixture(scope="module")
def published(dataset, tmp_path_factory):
    target = tmp_path_factory.mktemp("shelf") / "wide"
    assert publish(dataset, target, licence="cc-by-4.0") == 0
    return target


def test_the_folder_holds_what_it_should_and_its_hashes(published):
    manifest = json.loads((published / "manifest.json").read_text())
    found = made_up.contents(published)
    listed = {entry["file"]: (entry["sha256"], entry["bytes"]) for entry in manifest["files"]}
    del found["manifest.json"]
    assert listed == {file: (hashlib.sha256(content).hexdigest(), len(content)) for file, content in found.items()}
    texts = {"README.md", "croissant.json", "CITATION.cff", "recipe.toml", "load.py"}
    texts |= {f"fabrics/{name}.toml" for name in ("denim", "own", "twill_4_4")}
    texts |= {"population.toml", "unseen_population.toml"}
    assert {file for file in found if not file.startswith("data/")} == texts
    rows = Counter()
    for entry in manifest["files"]:
        if "role" in entry:
            rows[entry["role"], entry["split"]] += sum(entry["rows"].values())
    assert rows == ROWS and manifest["rows"] == sum(ROWS.values())
    held_out = {entry["file"] for entry in manifest["files"] if entry.get("split") == "test"}
    assert held_out == {file for file in found if "/test_only-" in file}


def test_no_row_is_lost_or_changed_and_the_door_reads_it_as_the_data_set_itself(published, dataset):
    def rows(frame):
        return frame.sort_values(list(frame.columns)).reset_index(drop=True)

    before = pd.concat([pq.read_table(path).to_pandas() for path in dataset.glob("*.parquet")])
    after = pd.concat([pq.read_table(path).to_pandas() for path in published.rglob("*.parquet")])
    before["fabric"] = before["fabric"].astype(str)
    pd.testing.assert_frame_equal(rows(before), rows(after.astype({"fabric": str})), check_dtype=False)
    ours, theirs = twillight.open_dataset(dataset), twillight.open_dataset(published)
    assert (ours.fabrics, ours.roles) == (theirs.fabrics, theirs.roles)
    for split in ("train", "validation", "test"):
        assert ours.pandas(split).equals(theirs.pandas(split))
    for mine, other in zip(ours.numpy("own", "train"), theirs.numpy("own", "train"), strict=True):
        assert all(np.array_equal(*columns) for columns in zip(mine, other, strict=True))
    batches = list(theirs.torch("train", rows=50))
    assert sum(len(batch["u"]) for batch in batches) == ROWS["seen", "train"] + ROWS["population", "train"]


def test_pandas_and_the_loader_read_it(published):
    code = (
        "import sys; sys.path.insert(0, '.')\n"
        "from load import load; assert 'twillight' not in sys.modules\n"
        "print(len(load('seen', 'train')), len(load('seen', 'test', 'denim')))\n"
        "print(load('population', 'train').fabric.nunique())"
    )
    done = subprocess.run([sys.executable, "-IB", "-c", code], cwd=published, capture_output=True, text=True)
    assert done.stdout.split() == ["320", "64", "3"], done.stderr
    lines = (published / "load.py").read_text().splitlines()
    assert len([line for line in lines if line.strip()]) <= 11  # and a docstring


def test_the_door_refuses_damaged_files(published, tmp_path):
    copy = tmp_path / "copy"
    shutil.copytree(published, copy)
    data = twillight.open_dataset(copy)
    first, second, *_ = sorted(copy.glob("data/seen/test_only-*.parquet"))
    whole = first.read_bytes()
    flipped = whole[:1000] + bytes(byte ^ 1 for byte in whole[1000:2000]) + whole[2000:]
    for content, words in ((flipped, "get the data set again"), (second.read_bytes(), "has 0 rows of denim")):
        first.write_bytes(content)
        assert words in refusal(data.pandas, "test")
    first.unlink()
    assert "get the whole data set" in refusal(data.pandas, "test")
    (copy / "manifest.json").write_text("{}")
    assert "not a manifest" in refusal(twillight.open_dataset, copy)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of the libraries that it uses
def test_croissant_reads_the_rows(published):
    described = mlcroissant.Dataset(jsonld=str(published / "croissant.json"))
    assert not described.metadata.ctx.issues.errors
    sets = {one.name: one for one in described.metadata.record_sets}
    assert set(sets) == {f"{role}-{split}" for role, split in ROWS}
    for role, split in ROWS:
        found = list(described.records(record_set=f"{role}-{split}"))
        assert len(found) == ROWS[role, split]
        values = {key.rpartition("/")[2]: value for key, value in found[0].items()}
        assert list(values) == SCHEMA.names and values["diffuse_warp"] == pytest.approx(0.1)
    meanings = [field.description for field in sets["seen-test"].fields]
    assert meanings == [field.metadata[b"meaning"].decode() for field in SCHEMA]


def test_card_and_citation_have_what_data_hubs_and_the_format_require(published):
    _, header, text = (published / "README.md").read_text(encoding="utf-8").split("---\n", 2)
    found = yaml.safe_load(header)
    assert found["license"] == "cc-by-4.0" and found["size_categories"] == ["n<1K"]
    files = {(c["config_name"], file["split"]): file["path"] for c in found["configs"] for file in c["data_files"]}
    assert {key: sum(pq.read_metadata(p).num_rows for p in published.glob(name)) for key, name in files.items()} == ROWS
    assert [config["config_name"] for config in found["configs"] if config.get("default")] == ["seen"]
    assert all(f"| `{name}` |" in text for name in SCHEMA.names) and "{" not in text.partition("```bibtex")[0]
    found = yaml.safe_load((published / "CITATION.cff").read_text(encoding="utf-8"))
    assert {"cff-version", "message", "title", "authors"} <= found.keys()
    assert found["type"] == "dataset" and found["license"] == "CC-BY-4.0"


@pytest.mark.parametrize("more", [(), ("neumip",)], ids=["", "rows of unseen fabrics too"])
def test_the_recipe_generates_the_same_rows(more, tmp_path):
    folder = write_dataset(tmp_path / "made", *more)
    assert publish(folder, tmp_path / "shelf") == 0
    unseen = {path.name.partition("-")[0] for path in (tmp_path / "shelf" / "data" / "unseen").iterdir()}
    assert unseen == {"test_only", *(("one_cloth_train", "one_cloth_validation") if more else ())}
    assert DataSet(load_recipe(tmp_path / "shelf" / "recipe.toml")).fingerprint == Manifest.load(folder).fingerprint


def test_many_fabrics_share_files_which_duckdb_reads(published, dataset, tmp_path, monkeypatch):
    monkeypatch.setattr("jobs.verbs.publish.contents.MOST_FILES", 4)
    assert publish(dataset, tmp_path / "few") == 0
    assert len(list((tmp_path / "few").rglob("*.parquet"))) == 6 < len(list(published.rglob("*.parquet")))
    sums = f"SELECT fabric, count(*), avg(diffuse_warp) FROM '{tmp_path}/few/data/*/*.parquet' GROUP BY 1"
    rows = {name: (count, round(mean, 6)) for name, count, mean in duckdb.sql(sums).fetchall()}
    assert rows["own"] == (256, 0.1) and rows["unseen_1_large_satin"] == (64, 0.1)
    assert sum(count for count, _ in rows.values()) == sum(ROWS.values())


def test_a_stopped_run_leaves_nothing_and_is_continued(published, dataset, tmp_path, monkeypatch):
    """In the end it has the bytes of an undisturbed one, also where an empty folder is."""
    target, done = tmp_path / "wide", []

    def stopped(path, *rest):
        if len(done) == 3:
            raise KeyboardInterrupt
        done.append(path)
        joined(path, *rest)

    joined = verb.join_shards
    monkeypatch.setattr(verb, "join_shards", stopped)
    own = tmp_path / ".tmp-wide" / "notes.txt"
    own.parent.mkdir()
    own.write_text("mine")
    assert publish(dataset, target) == 2 and own.read_text() == "mine"
    own.unlink()
    assert publish(dataset, target) == 130 and not target.exists()
    kept = {path: (path.stat().st_mtime_ns, path.stat().st_ino) for path in done[1:]}
    done[0].write_bytes(done[0].read_bytes()[:-50] + bytes(50))  # damaged meanwhile
    (done[0].parent / "odd.parquet").touch()
    monkeypatch.undo()
    target.mkdir()
    assert publish(dataset, target) == 0 and made_up.contents(target) == made_up.contents(published)
    moved = [target / path.relative_to(tmp_path / ".tmp-wide") for path in kept]
    assert [(path.stat().st_mtime_ns, path.stat().st_ino) for path in moved] == list(kept.values())
    assert [path.name for path in tmp_path.iterdir()] == ["wide"]


@pytest.fixture
def unpublished(refused, tmp_path):
    """Publish a data set, which must be refused; return the sentence."""

    def unpublished(folder, to="new"):
        before = set(tmp_path.iterdir())
        sentence = refused("publish", folder, "--to", to, "--licence", "MIT")
        assert set(tmp_path.iterdir()) == before
        return sentence

    return unpublished


def test_a_data_set_that_is_old_or_not_whole_or_a_folder_that_cannot_be_written_is_refused(tmp_path, unpublished):
    folder = write_dataset(tmp_path / "made")
    manifest = Manifest.load(folder)
    first, second = manifest.shards[:2]
    truth = manifest.about["truth"] | {"geometry": "torus"}
    manifest.model_copy(update={"about": manifest.about | {"truth": truth}}).save(folder)
    assert "is of another version (dataset.truth.geometry = 'torus')" in unpublished(folder)
    manifest.model_copy(update={"about": manifest.about | {"shard_rows": 128}}).save(folder)
    assert "its rows are not those of a recipe" in unpublished(folder)
    # Not finished: the manifest lists what is there.
    manifest.without({first.file}).save(folder)
    error = unpublished(folder)
    assert "is not whole" in error and "twillight generate wide" in error
    manifest.save(folder)
    (tmp_path / "file").touch()
    assert "a folder that can be written is needed" in unpublished(folder, "file/new")
    (folder / first.file).write_bytes((folder / second.file).read_bytes())
    assert file_sha256(folder / first.file) == second.sha256 and "SHA-256" in unpublished(folder)


CITED = {"title": "Eight cloths & more", "date": "2026-11-26", "url": "https://looms.org/x", "doi": "10.5281/zenodo.7"}


def test_a_citation_is_the_same_everywhere_and_a_licence_that_hubs_do_not_know_has_a_name_and_an_address(
    dataset, tmp_path
):
    flags = [part for name, value in CITED.items() for part in (f"--{name}", value)]
    flags += ["--author", "Weaver, Ada", "--author", "The Guild"]
    assert publish(dataset, tmp_path / "x", *flags, licence="EUPL-1.2") == 0
    names = ("README.md", "croissant.json", "CITATION.cff")
    card, croissant, cff = ((tmp_path / "x" / name).read_text(encoding="utf-8") for name in names)
    cited, described = yaml.safe_load(cff), json.loads(croissant)
    assert cited["authors"] == [{"family-names": "Weaver", "given-names": "Ada"}, {"name": "The Guild"}]
    assert [person["name"] for person in described["creator"]] == ["Ada Weaver", "The Guild"]
    assert [str(cited[key]) for key in ("title", "date-released", "url", "doi")] == list(CITED.values())
    assert [described[key] for key in ("name", "datePublished", "url")] == list(CITED.values())[:3]
    assert described["sameAs"] == f"https://doi.org/{CITED['doi']}"
    for entry in ("title = {{Eight cloths \\& more}}", "author = {Weaver, Ada and {The Guild}}", "year = {2026}"):
        assert entry in described["citeAs"]
    assert "Ada Weaver, The Guild (2026): Eight cloths & more. Version" in card and described["citeAs"] in card
    header = yaml.safe_load(card.split("---\n")[1])
    assert header["pretty_name"] == CITED["title"]
    assert (header["license"], header["license_name"]) == ("other", "eupl-1.2")
    assert header["license_link"] == "https://spdx.org/licenses/EUPL-1.2.html"
