import numpy as np
import OpenEXR
import pyarrow as pa
import pyarrow.parquet as pq
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pyarrow import csv

from pipeline.shards.sample_file import LIST_FILE, read_samples
from tests.directions import sphere
from tests.refusals import refusal

SHAPE = ROWS, COLUMNS = 3, 4
FRONT = sphere(20, 20)[200:].astype(np.float32)


def samples(seed=0, count=60):
    """Return columns of samples: some for every texel, others anywhere."""
    random = np.random.default_rng(seed)
    texel = np.concatenate([np.arange(ROWS * COLUMNS), random.integers(0, ROWS * COLUMNS, count)])
    places = np.divmod(texel, COLUMNS) + random.uniform(0.05, 0.95, (2, len(texel)))
    wi, wo = (FRONT[random.integers(0, len(FRONT), len(texel))] for _ in "io")
    columns = {"v": places[0] / ROWS, "u": places[1] / COLUMNS}
    columns |= {f"{name}_{axis}": w[:, i] for name, w in (("wi", wi), ("wo", wo)) for i, axis in enumerate("xyz")}
    columns |= dict(zip(("red", "green", "blue"), random.uniform(0.0, 0.1, (3, len(texel))), strict=True))
    return columns, texel


def write(path, columns):
    table = pa.table(columns)
    csv.write_csv(table, path) if path.suffix == ".csv" else pq.write_table(table, path)
    return path


@settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(0, 2**31), st.sampled_from([".csv", ".parquet"]))
def test_rows_of_either_form_are_sorted_into_texels(tmp_path, seed, ending):
    columns, texel = samples(seed)
    read = read_samples(write(tmp_path / f"a{ending}", columns | {"note": ["x"] * len(texel)}), (COLUMNS, ROWS))
    assert read.shape == SHAPE
    np.testing.assert_array_equal(read.texel, texel)
    for name, array in (("wi_y", read.wi[:, 1]), ("wo_x", read.wo[:, 0]), ("blue", read.rgb[:, 2])):
        np.testing.assert_array_equal(array, columns[name].astype(np.float32))


def write_exr(path, picture):
    with OpenEXR.File({}, {"RGB": np.ascontiguousarray(picture)}) as file:
        file.write(str(path))


def test_a_place_on_the_edge_of_a_texel_is_of_the_one_above(tmp_path):
    columns, _ = samples()
    for count in (47, 49, 98, 100, 200):
        for kind in (np.float32, np.float64):
            u = (np.arange(count) / count).astype(kind)
            rows = np.resize(np.arange(len(columns["u"])), count)
            table = {name: values[rows] for name, values in columns.items()} | {"u": u, "v": np.zeros(count)}
            read = read_samples(write(tmp_path / "a.parquet", table), (count, 1))
            np.testing.assert_array_equal(read.texel, np.arange(count))


def test_pictures_are_the_same_samples_as_their_table(tmp_path):
    """The top row of a picture has the largest v."""
    random, pairs = np.random.default_rng(1), FRONT[::37][:6].reshape(3, 2, 3)
    pictures = random.uniform(0.0, 0.1, (3, *SHAPE, 3)).astype(np.float32)
    names = [f"{name}_{axis}" for name in ("wi", "wo") for axis in "xyz"]
    lines = [",".join(["file", *names])]
    for number, (picture, pair) in enumerate(zip(pictures, pairs, strict=True)):
        write_exr(tmp_path / f"{number}.exr", picture)
        lines.append(",".join([f"{number}.exr", *map(repr, pair.ravel().tolist())]))
    (tmp_path / LIST_FILE).write_text("\ufeff" + "\n".join(lines).replace(",", ", "))
    read = read_samples(tmp_path)
    assert read.shape == SHAPE
    sample, row, column = 2, 0, 3
    (index,) = np.flatnonzero((read.texel == row * COLUMNS + column) & (read.wi == pairs[sample, 0]).all(axis=1))
    np.testing.assert_array_equal(read.rgb[index], pictures[sample, ROWS - 1 - row, column])
    np.testing.assert_array_equal(read.wo[index], pairs[sample, 1])
    assert "leave it out" in refusal(read_samples, tmp_path, (4, 3))
    write_exr(tmp_path / "1.exr", np.zeros((2, 2, 3), np.float32))
    assert "must be 4 x 3" in refusal(read_samples, tmp_path)
    (tmp_path / "1.exr").write_bytes(b"no picture")
    assert "1.exr" in (sentence := refusal(read_samples, tmp_path)) and "OpenEXR" in sentence
    listed = (tmp_path / LIST_FILE).read_text()
    for text, said in (
        ("file,wi_x\n0.exr,up", "row 0"),
        (lines[0], "pictures = '0'"),
        (listed.replace("1.exr", "../1.exr"), "of the same folder"),
        (listed.replace("1.exr", "9.exr"), "9.exr: does not exist"),
        ("x" * 200_000, "cannot be read"),
    ):
        (tmp_path / LIST_FILE).write_text(text)
        assert said in refusal(read_samples, tmp_path), said
    (tmp_path / LIST_FILE).unlink()
    assert f"{LIST_FILE}: does not exist" in refusal(read_samples, tmp_path)


REFUSED = [
    ({"wi_z": -0.5}, ("row 5, column wi", "unit vector")),
    ({"wo_x": 0.6, "wo_y": 0.0, "wo_z": -0.8}, ("row 5, column wo", "front of the cloth")),
    ({"u": 1.25}, ("row 5, column u", "[0, 1)")),
    ({"green": np.nan}, ("row 5, column red, green, blue", "finite")),
    ({"blue": -0.1}, ("row 5", "at least 0")),
    ({"red": 4000.0}, ("the mean of RGB", "1/sr")),
    ({"texel": None}, ("texel = 'row 0, column 2'", "1 of 12 texels have no sample")),
    ({"red": None}, ("column = 'red'", "is missing")),
]


def test_what_cannot_be_used_is_refused_by_one_sentence(tmp_path):
    for change, expected in REFUSED:
        columns, texel = samples()
        for name, value in change.items():
            if name == "texel":
                columns = {key: values[texel != 2] for key, values in columns.items()}
            elif value is None:
                del columns[name]
            else:
                columns[name][5] = value
        sentence = refusal(read_samples, write(tmp_path / "a.parquet", columns), (COLUMNS, ROWS))
        assert "a.parquet" in sentence and all(part in sentence for part in expected), sentence
    assert "such as 64x64" in refusal(read_samples, tmp_path / "a.parquet")
    assert "texels = '4,000,000'" in refusal(read_samples, tmp_path / "a.parquet", (2000, 2000))
