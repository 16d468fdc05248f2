import json

import numpy as np
import pyarrow.parquet as pq
import pytest
from pydantic import TypeAdapter

from pipeline.fingerprint import file_sha256
from pipeline.shards.check import check_shard
from pipeline.shards.generate import AnyShardTask, ExtraShardTask, ShardTask, generate_shard, set_name
from pipeline.shards.manifest import Manifest, ShardEntry
from pipeline.shards.store import numbers_of, read_about, read_table, rows_of, write_columns
from pipeline.truth.options import TruthOptions
from tests.pipeline.shards.extra import GRAZING, OPACITY, SAMPLES
from tests.refusals import refusal
from weaves.errors import BadInput
from weaves.fabric import load_fabric

COARSE = TruthOptions(relative_error=0.1, min_count=64, max_count=128)
TASK = ShardTask(fabric=load_fabric("denim"), split="test", start=32, rows=100, seed=3, truth=COARSE)
EXTRA = [SAMPLES.model_copy(update={"texels_per_yarn": 1}), OPACITY, GRAZING]


def read_shard(path):
    return rows_of(numbers_of(read_table(path)))


@pytest.fixture
def folder(tmp_path):
    generate_shard(TASK, tmp_path / "part-a.parquet")
    return tmp_path


def _entry(path, start, rows, **facts):
    facts = {"fabric": "denim", "split": "test"} | facts
    return ShardEntry(file=path.name, start=start, rows=rows, sha256=file_sha256(path), **facts)


def _manifest(*entries):
    facts = {"name": "t", "fingerprint": "0", "roles": {"seen": ["denim"]}, "about": {}}
    return Manifest(fabrics={"denim": TASK.fabric}, shards=entries, **facts)


def test_the_same_task_gives_the_same_bytes_in_any_cut_which_a_manifest_reads_in_stream_order(folder):
    generate_shard(TASK, folder / "again.parquet")
    assert (folder / "again.parquet").read_bytes() == (folder / "part-a.parquet").read_bytes()
    generate_shard(TASK.model_copy(update={"start": 52, "rows": 10}), folder / "cut.parquet")
    queries, answers = read_shard(folder / "part-a.parquet")
    cut_queries, cut_answers = read_shard(folder / "cut.parquet")
    for whole, part in zip((*queries, *answers), (*cut_queries, *cut_answers), strict=True):
        np.testing.assert_array_equal(whole[20:30], part)
    generate_shard(TASK.model_copy(update={"start": 0, "rows": 32}), folder / "part-b.parquet")
    _manifest(_entry(folder / "part-a.parquet", 32, 100), _entry(folder / "part-b.parquet", 0, 32)).save(folder)
    loaded = Manifest.load(folder)
    assert [entry.start for entry in loaded.shards] == [0, 32]
    queries, answers = loaded.read(folder, "denim", "test")
    np.testing.assert_array_equal(queries.u[:32], read_shard(folder / "part-b.parquet")[0].u)
    assert answers.mean.shape == (132, 4)
    before = (folder / "manifest.json").read_bytes()
    loaded.save(folder)
    assert (folder / "manifest.json").read_bytes() == before
    assert "no rows" in refusal(loaded.read, folder, "denim", "train")


def test_a_shard_explains_itself_and_splits_and_fabrics_draw_different_queries(folder):
    about = read_about(folder / "part-a.parquet")
    assert about["task"]["truth"]["normaliser"] == "visible"
    assert b"signed" in pq.read_schema(folder / "part-a.parquet").field("wi_z").metadata[b"meaning"]
    group = pq.read_metadata(folder / "part-a.parquet").row_group(0)
    assert {group.column(column).compression for column in range(group.num_columns)} == {"ZSTD"}
    generate_shard(TASK.model_copy(update={"split": "train"}), folder / "train.parquet")
    first, second = (read_shard(folder / name)[0] for name in ("part-a.parquet", "train.parquet"))
    assert not np.intersect1d(first.u, second.u).size


def test_a_manifest_is_written_as_json_writes_it_and_identity_follows_optics_and_parameters():
    extra = [ExtraShardTask(fabric=TASK.fabric, extra=extra, start=0, rows=8) for extra in EXTRA]
    for task in (TASK, *extra):
        dyed, rough = (
            task.fabric.model_copy(update={"warp": task.fabric.warp.model_copy(update=change)})
            for change in ({"diffuse": "#112233"}, {"roughness": 0.33})
        )
        assert task.model_copy(update={"fabric": dyed}).identity() == task.identity()
        assert task.model_copy(update={"fabric": rough}).identity() != task.identity()
        assert task.model_copy(update={"start": 1}).identity() != task.identity() and "version" in task.identity()
    assert len({json.dumps(task.identity()) for task in extra}) == len({task.split for task in extra}) == 3
    facts = {"fabric": 'a "cloth" –,\n {}', "split": "test", "rows": 2, "sha256": ""}
    entries = [ShardEntry(file=f"part-{start}.parquet", start=start, **facts) for start in (4, 2, 0)]
    for shards in ([], entries):
        manifest = _manifest(*shards)
        expected = manifest.model_copy(update={"shards": shards[::-1]}).model_dump(mode="json")
        assert manifest.encoded().decode() == json.dumps(expected, indent=1, sort_keys=True) + "\n"


def flipped(content, position):
    return content[:position] + bytes([content[position] ^ 4]) + content[position + 1 :]


def test_damage_is_named(folder):
    path = folder / "part-a.parquet"
    entry = _entry(path, 32, 100)
    manifest = _manifest(entry)
    assert check_shard(folder, entry, manifest) == []
    sound = path.read_bytes()

    # A flipped byte in the middle of a page: the checksum of the page sees it.
    for position in range(300, len(sound) - 4000, 701):
        path.write_bytes(flipped(sound, position))
        assert any("SHA-256" in fault for fault in check_shard(folder, entry, manifest))

    # Nor is a flipped byte of data read.
    path.write_bytes(sound)
    column = pq.read_metadata(path).row_group(0).column(3)
    position = column.data_page_offset + column.total_compressed_size - 20
    for content in (flipped(sound, position), sound[: len(sound) // 2]):
        path.write_bytes(content)
        assert "not a whole Parquet file" in refusal(read_shard, path)
    path.unlink()
    assert "does not exist" in refusal(read_shard, path)
    assert "does not exist" in check_shard(folder, entry, manifest)[0]


@pytest.mark.parametrize("text", ["", "{", "[]", json.dumps({"name": "x"})])
def test_a_broken_manifest_is_one_sentence(tmp_path, text):
    (tmp_path / "manifest.json").write_text(text)
    with pytest.raises(BadInput, match=r"manifest is needed|not a manifest"):
        Manifest.load(tmp_path)
    assert "does not exist" in refusal(Manifest.load, tmp_path / "nowhere")


def _extra(folder, extra):
    """Write the extra rows of denim in two shards and return their manifest."""
    entries = []
    for start, rows in ((0, 40), (40, 24)):
        task = ExtraShardTask(fabric=TASK.fabric, extra=extra, start=start, rows=rows)
        path = folder / f"part-{start}.parquet"
        generate_shard(TypeAdapter(AnyShardTask).validate_json(task.model_dump_json()), path)
        entries.append(_entry(path, start, rows, kind=task.kind, split=task.split))
    return _manifest(*entries)


@pytest.mark.parametrize("extra", EXTRA, ids=lambda extra: extra.kind)
def test_extra_rows_are_shards_like_all_others(folder, extra):
    """Written, checked and read back in stream order: the same as in one piece."""
    manifest = _extra(folder, extra)
    assert [fault for entry in manifest.shards for fault in check_shard(folder, entry, manifest)] == []
    manifest.save(folder)
    read = Manifest.load(folder).columns(folder, "denim", set_name(extra))
    generate_shard(ExtraShardTask(fabric=TASK.fabric, extra=extra, start=0, rows=64), folder / "whole.parquet")
    whole = numbers_of(read_table(folder / "whole.parquet", extra.kind))
    assert read.keys() == whole.keys()
    for name, column in whole.items():
        np.testing.assert_array_equal(read[name], column)
    assert "no rows" in refusal(manifest.columns, folder, "denim", set_name(SAMPLES.model_copy(update={"samples": 5})))


def test_damaged_extra_rows_are_named(folder):
    manifest = _extra(folder, OPACITY)
    entry = manifest.shards[0]
    path = folder / entry.file
    column = numbers_of(read_table(path, "opacity"))
    write_columns(path, "opacity", "denim", column | {"opacity": 2 * column["opacity"] + 1}, {})
    faults = check_shard(folder, entry, manifest)
    assert any("SHA-256" in fault for fault in faults)
    assert any("column opacity spans" in fault for fault in faults)
    # One kind read as another is refused, never misread.
    misread = entry.model_copy(update={"kind": "components"})
    assert "must be schema version" in check_shard(folder, misread, manifest)[-1]
