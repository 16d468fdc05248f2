"""A synthetic BTF: any number and order of samples, the same bytes for the same task, damage noticed everywhere."""

import numpy as np
import pyarrow.parquet as pq
import pytest
from pydantic import ValidationError

from pipeline.shards import btf_store
from pipeline.shards.btf import BtfTask, generate_btf
from pipeline.shards.btf_store import SCHEMA, read_btf
from pipeline.truth import estimator
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from weaves.errors import BadInput
from weaves.fabric import load_fabric

TASK = BtfTask(
    fabric=load_fabric("denim"),
    texels_per_yarn=2,
    samples=(0, 9),
    seed=3,
    truth=TruthOptions(estimator="owen", relative_error=0.1, min_count=64, max_count=128),
)


def _made(path, **changes):
    generate_btf(TASK.model_copy(update=changes), path)
    return read_btf(path)[0]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    path = tmp_path_factory.mktemp("btf") / "denim.parquet"
    generate_btf(TASK, path)
    return path


def test_texels_hold_any_number_of_samples(made):
    btf, about = read_btf(made)
    counts = np.diff(btf.offsets)
    assert len(btf.u) == 64
    assert set(counts) == set(range(10)), "64 texels draw every number from 0 to 9"
    assert btf.offsets[-1] == len(btf.rgb) == counts.sum()
    assert about["task"] == TASK.identity() | {"samples": [0, 9]}
    # Rows along y, columns along x; the centres are those of the texels.
    np.testing.assert_array_equal(btf.u[:8], (np.arange(8) + 0.5) / 2)
    np.testing.assert_array_equal(btf.v[::8], (np.arange(8) + 0.5) / 2)
    assert (btf.sigma == 0.25).all()
    for name in ("wi", "wo"):
        directions = getattr(btf, name)
        np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1, atol=1e-6)
        assert (directions[:, 2] > np.cos(np.radians(80.01))).all()
    assert len(np.unique(btf.wi, axis=0)) == len(btf.wi), "every sample has a direction of its own"


def test_order_changes_the_places_of_samples_alone(made, tmp_path):
    btf, again = read_btf(made)[0], _made(tmp_path / "b.parquet", order=1)
    np.testing.assert_array_equal(btf.offsets, again.offsets)
    moved = 0
    for texel in range(64):
        first, second = (np.concatenate(b.texel(texel), axis=1) for b in (btf, again))
        moved += not np.array_equal(first, second)
        np.testing.assert_array_equal(np.sort(first, axis=0), np.sort(second, axis=0))
        np.testing.assert_array_equal(first[first[:, 0].argsort()], second[second[:, 0].argsort()])
    assert moved > 30


def test_the_same_task_gives_the_same_bytes(made, tmp_path):
    generate_btf(TASK, tmp_path / "again.parquet")
    assert (tmp_path / "again.parquet").read_bytes() == made.read_bytes()


def test_a_texel_depends_on_its_own_index_alone(made, tmp_path):
    btf, cut = read_btf(made)[0], _made(tmp_path / "cut.parquet", start=17, texels=5)
    for texel in range(5):
        for whole, part in zip(btf.texel(17 + texel), cut.texel(texel), strict=True):
            np.testing.assert_array_equal(whole, part)
    np.testing.assert_array_equal(cut.u, btf.u[17:22])


def test_many_row_groups_read_as_one(made, tmp_path, monkeypatch):
    monkeypatch.setattr(btf_store, "_ROW_GROUP", 7)
    for first, second in zip(read_btf(made)[0], _made(tmp_path / "b.parquet"), strict=True):
        np.testing.assert_array_equal(first, second)
    assert pq.read_metadata(tmp_path / "b.parquet").num_row_groups == 10


def test_samples_are_the_estimates_in_the_colours_of_the_fabric(tmp_path, monkeypatch):
    """The very answers of `estimate`, and within 5 standard errors of a fine estimate with other random numbers."""
    asked = []

    def record(*arguments):
        asked.append((arguments[1], estimate(*arguments)))
        return asked[-1][1]

    estimate = estimator.estimate
    monkeypatch.setattr(estimator, "estimate", record)
    btf = _made(tmp_path / "b.parquet", start=20, texels=8, samples=(16, 16))
    warp, weft = TASK.fabric.warp, TASK.fabric.weft
    colours = np.array([warp.specular_rgb, weft.specular_rgb, warp.diffuse_rgb, weft.diffuse_rgb])
    fine = TruthOptions(estimator="owen", relative_error=1e-3, min_count=1 << 12, max_count=1 << 12)
    scores = []
    for texel, (queries, answers) in enumerate(asked):
        wi, wo, rgb, error = btf.texel(texel)
        place = np.array([np.flatnonzero((queries.wi == w).all(axis=1))[0] for w in wi])
        assert sorted(place) == list(range(16))
        np.testing.assert_array_equal(queries.wo[place], wo)
        np.testing.assert_allclose(rgb, (answers.mean @ colours)[place], rtol=1e-6)
        assert (error <= (answers.standard_error @ colours)[place] * 1.000001).all()
        column = np.ones(16, np.float32)
        own = Queries.round(btf.u[texel] * column, btf.v[texel] * column, btf.sigma[texel] * column, wi, wo)
        exact = estimate(TASK.fabric, own, fine, 99)
        spread = np.hypot(error, exact.standard_error @ colours)
        scores.append(np.abs(rgb - exact.mean @ colours) / (spread + 1e-4 * rgb + 1e-9))
    assert np.mean(np.array(scores) > 5) < 0.02
    assert 0.4 < np.median(scores) < 1.0


def test_identity_follows_colours_and_optics_and_not_the_source():
    def identity(**changes):
        warp = TASK.fabric.warp.model_copy(update=changes)
        return TASK.model_copy(update={"fabric": TASK.fabric.model_copy(update={"warp": warp})}).identity()

    assert identity() == TASK.identity()
    assert identity(diffuse="#112233") != TASK.identity()
    assert identity(roughness=0.33) != TASK.identity()
    assert TASK.model_copy(update={"order": 1}).identity() != TASK.identity()


def test_a_file_explains_itself(made):
    schema, metadata = pq.read_schema(made), pq.read_metadata(made).row_group(0)
    assert schema.equals(SCHEMA)
    record = schema.field("samples").type.value_type
    assert all(b"meaning" in record.field(k).metadata for k in range(record.num_fields))
    for k in range(metadata.num_columns):
        assert metadata.column(k).compression == "ZSTD"
        assert "BYTE_STREAM_SPLIT" in metadata.column(k).encodings


def test_damage_is_one_sentence_or_harmless(made, tmp_path):
    """Flip bytes all over the file, footer included: what is read is what was written, or BadInput."""
    sound, (btf, about), path = made.read_bytes(), read_btf(made), tmp_path / "b.parquet"
    refused = 0
    positions = range(0, len(sound), 211)
    for position in positions:
        path.write_bytes(sound[:position] + bytes([sound[position] ^ 4]) + sound[position + 1 :])
        try:
            read, facts = read_btf(path)
        except BadInput as error:
            refused += 1
            assert "\n" not in str(error)
            continue
        assert facts == about
        assert all(np.array_equal(a, b) for a, b in zip(read, btf, strict=True))
    assert refused > len(positions) / 2
    for length in (0, 3, len(sound) // 2, len(sound) - 1):
        path.write_bytes(sound[:length])
        with pytest.raises(BadInput, match="not a whole Parquet file"):
            read_btf(path)
    with pytest.raises(BadInput, match="does not exist"):
        read_btf(tmp_path / "nowhere.parquet")
    pq.write_table(pq.read_table(made, columns=["u"]), path)
    with pytest.raises(BadInput, match="must be a synthetic BTF"):
        read_btf(path)


def test_pages_with_sound_checksums_and_other_values_are_refused(made, tmp_path):
    table = pq.read_table(made)
    changed = table.set_column(0, table.schema.field("u"), [np.roll(table.column("u").to_numpy(), 1)])
    pq.write_table(changed, tmp_path / "b.parquet")
    with pytest.raises(BadInput, match="SHA-256 differs"):
        read_btf(tmp_path / "b.parquet")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"samples": (5, 4)}, "0 <= low <= high"),
        ({"samples": (0, 1 << 21)}, "0 <= low <= high"),
        ({"start": 60, "texels": 5}, "do not exist"),
        ({"start": 64}, "do not exist"),
        ({"sigma": 0.0}, "greater than 0"),
    ],
)
def test_impossible_tasks_are_refused(changes, words):
    with pytest.raises(ValidationError, match=words):
        BtfTask(**{"fabric": TASK.fabric, "texels_per_yarn": 2, "seed": 0, **changes})
