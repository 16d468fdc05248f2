import numpy as np
import pytest
import torch
from torch.utils.data import DataLoader

from pipeline.shards.manifest import Manifest, ShardEntry
from pipeline.shards.pieces import DatasetRows
from pipeline.shards.store import ROW_GROUP, read_table
from pipeline.training import dataset
from pipeline.training.dataset import COLUMNS, Order, RowStream, TrainingRows
from pipeline.truth.query import Answers, Queries
from tests.datasets import write_dataset
from tests.refusals import refusal


def test_order_is_a_function_of_seed_and_step():
    forwards = Order([[100], [50], [70]], batch=32, fabrics=2, seed=7)
    steps = [forwards.step(step) for step in range(40)]
    for step in (39, 0, 17):  # another order of asking, another object
        fabrics, rows = Order([[100], [50], [70]], batch=32, fabrics=2, seed=7).step(step)
        np.testing.assert_array_equal(fabrics, steps[step][0])
        np.testing.assert_array_equal(rows, steps[step][1])
    assert not np.array_equal(Order([[100], [50], [70]], 32, 2, seed=8).step(0)[1], steps[0][1])
    assert sorted(np.bincount(Order([[3]], batch=8, fabrics=1, seed=0).step(0)[1][0])) == [2, 3, 3]
    order = Order([[10], [10]], batch=9, fabrics=8, seed=0)
    assert (order.fabrics, order.each) == (2, 4)


def test_batches_hold_the_rows_of_their_fabrics(folder):
    rows = TrainingRows(Manifest.load(folder), folder, NAMES, torch.device("cpu"))
    order = Order(rows.windows, batch=12, fabrics=2, seed=3)
    fabrics, numbers = order.step(5)
    batch = rows.batch(fabrics, numbers)
    np.testing.assert_array_equal(batch.fabric, fabrics)
    for own, fabric, places in zip(batch.u, fabrics, numbers, strict=True):
        queries, _ = Manifest.load(folder).read(folder, NAMES[fabric], "train")
        np.testing.assert_array_equal(own, queries.u[places])


@pytest.mark.parametrize("windows", [[48], [16, 32], [16, 16, 16]])
def test_every_round_visits_every_fabric_and_every_epoch_every_row_once(windows):
    order = Order([[64]] * 5, batch=10, fabrics=5, seed=1)
    for step in range(8):
        assert sorted(order.step(step)[0]) == [0, 1, 2, 3, 4]
    order = Order([windows, windows], batch=32, fabrics=2, seed=1)
    epochs = []
    for epoch in range(3):
        seen = {0: [], 1: []}
        for step in range(3 * epoch, 3 * epoch + 3):
            for fabric, rows in zip(*order.step(step), strict=True):
                seen[int(fabric)].extend(rows.tolist())
        assert sorted(seen[0]) == sorted(seen[1]) == list(range(48))
        epochs += seen.values()
    assert len(set(map(tuple, epochs))) == 6


def test_columns_are_where_batches_look_for_them(tmp_path):
    numbers = np.split(np.arange(17, dtype=np.float32)[None], [1, 2, 3, 6, 9, 10, 11, 12, 16], axis=1)
    *columns, mean, transparency = (part[0] if part.size == 1 else part for part in numbers)
    queries = Queries(*columns)
    answers = Answers.opaque(mean, np.zeros((1, 4), np.float32), np.ones(1, np.int32))
    answers = answers._replace(transparency=transparency)
    write_dataset(tmp_path, {"seen": ["denim"]}, [("denim", "train", 0, queries, answers)])
    rows = TrainingRows(Manifest.load(tmp_path), tmp_path, ["denim"], torch.device("cpu"))
    np.testing.assert_array_equal(rows.spread(COLUMNS), np.arange(17)[None])
    batch = rows.batch(*Order([[1]], batch=1, fabrics=1, seed=0).step(0))
    for name in Queries._fields:
        np.testing.assert_array_equal(getattr(batch, name)[0], getattr(queries, name))
    np.testing.assert_array_equal(batch.target[0], answers.mean)
    assert batch.transparency.item() == 16


def test_the_rows_of_a_slice_are_of_one_window_and_the_oldest_permutations_are_forgotten(monkeypatch):
    """Windows of one fabric come in another order in each epoch; what is forgotten comes again."""
    monkeypatch.setattr(dataset, "_MOST_PERMUTATIONS", 1)
    windows = [[64, 64, 32], [64, 64, 32]]
    order, again = (Order(windows, batch=32, fabrics=2, seed=3) for _ in range(2))
    starts, orders = np.array([0, 64, 128]), []
    for epoch in range(6):
        visited = []
        for step in range(10 * epoch, 10 * epoch + 10):
            rows = order.step(step)[1]
            np.testing.assert_array_equal(rows, again.step(step)[1])
            found = np.searchsorted(starts, rows, side="right")
            assert (found == found[:, :1]).all()
            visited.append(int(found[0, 0]))
        assert order._kept.cache_info().currsize == 1
        orders.append(tuple(visited))
    assert len(set(orders)) > 1


def test_rows_that_stay_in_their_shards_are_those_of_the_table(folder, tmp_path, monkeypatch):
    """Every window of every fabric, in both orders of fabrics, as if row groups had a thousand rows."""
    cpu, manifest, orders = torch.device("cpu"), Manifest.load(folder), (NAMES, NAMES[::-1])
    tables = [TrainingRows(manifest, folder, names, cpu) for names in orders]
    every, some = tables[0].spread(2 * 4096), tables[0].spread(1000)
    np.testing.assert_array_equal(some, every[::8])
    for table in tables:
        table.spread(1)  # all is read
    monkeypatch.setattr(dataset, "MOST_IN_MEMORY", 4096)
    monkeypatch.setattr(dataset, "ROW_GROUP", 1000)
    monkeypatch.setattr(dataset, "read_table", groups_of_a_thousand)
    for names, table in zip(orders, tables, strict=True):
        windowed = TrainingRows(manifest, folder, names, cpu)
        assert [sum(own) for own in table.windows] == [4096] * 2 and windowed.windows == [[2000, 2096]] * 2
        for fabric in range(2):
            for start, rows in ((0, 2000), (2000, 2096)):
                own = np.array([fabric]), start + np.random.default_rng(start).permutation(rows)[None]
                np.testing.assert_array_equal(windowed.take(*own), table.take(*own))
        every = table.spread(2 * 4096)
        np.testing.assert_array_equal(windowed.spread(600), torch.cat([every[:300], every[4096:4396]]))


@pytest.mark.parametrize("least", [1, 2, 4, 8])
def test_windows_are_of_whole_row_groups_and_of_enough_rows(tmp_path, least, monkeypatch):
    monkeypatch.setattr(dataset, "ROW_GROUP", 10)
    rows = [25, 5, 1, 60, 9, 10, 3]
    shards = [
        ShardEntry(file=f"s{i}.parquet", fabric="x", split="train", start=0, rows=n, sha256="")
        for i, n in enumerate(rows)
    ]
    windows = dataset._windows(tmp_path, shards, 10 * least)
    sizes = [sum(piece.rows for piece in window) for window in windows]
    assert sum(sizes) == sum(rows) and min(sizes) >= 10 * least and max(sizes) < 30 * least
    pieces = [piece for window in windows for piece in window]
    read = [(piece.path.name, piece.first + group) for piece in pieces for group in range(-(-piece.rows // 10))]
    assert read == [(shard.file, group) for shard in shards for group in range(-(-shard.rows // 10))]


def groups_of_a_thousand(path, names, groups):
    return read_table(path, names=names).slice(1000 * groups.start, 1000 * (groups.stop - groups.start))


NAMES = ["cotton_twill", "polyester_lining"]
ROWS = 4096


def stream(folder, names=NAMES, **rest):
    return RowStream(DatasetRows.load(folder).of("train", names), **rest)


def rows_in(batches):
    columns = ("fabric", "u", "v", "sigma", "diffuse_weft")
    return [row for batch in batches for row in zip(*(batch[name].tolist() for name in columns), strict=True)]


def expected(folder):
    found = []
    for number, name in enumerate(NAMES):
        queries, answers = Manifest.load(folder).read(folder, name, "train")
        columns = queries.u, queries.v, queries.sigma, answers.mean[:, 3]
        found += [(number, *row) for row in zip(*(column.tolist() for column in columns), strict=True)]
    return found


def test_the_order_is_that_of_the_files_or_of_the_seed_well_shuffled(folder):
    assert rows_in(stream(folder, seed=None, rows=1000)) == expected(folder)
    one, other = stream(folder, seed=3), stream(folder, seed=4)
    first, second = rows_in(one), rows_in(one)
    assert first != second and sorted(first) == sorted(second) == sorted(expected(folder))
    assert rows_in(stream(folder, seed=3)) == first != rows_in(other)
    workers = DataLoader(stream(folder, seed=None), batch_size=None, num_workers=2)
    assert sorted(rows_in(workers)) == sorted(expected(folder))
    # The mean place of the first half of a shard's rows is that of all, within 5 standard errors.
    (batch,) = stream(folder, names=NAMES[:1], rows=ROWS)
    order = {u: place for place, u in enumerate(Manifest.load(folder).read(folder, NAMES[0], "train")[0].u.tolist())}
    places = np.array([order[u] for u in batch["u"].tolist()])
    assert abs(places[: ROWS // 2].mean() - (ROWS - 1) / 2) < 5 * ROWS / np.sqrt(12 * ROWS / 2)
    batch = next(iter(stream(folder, rows=7)))
    others = {name: values.dtype for name, values in batch.items() if values.dtype != torch.float32}
    assert others == {"fabric": torch.int64, "count": torch.int32}
    assert {len(values) for values in batch.values()} == {7}


def test_row_groups_of_a_shard_are_slices_of_it(folder, tmp_path):
    path = next(folder.glob("*.parquet"))
    whole = read_table(path, names=["u", "sigma"])
    assert read_table(path, names=["u", "sigma"], groups=slice(0, 8)).equals(whole) and whole.num_rows < ROW_GROUP
    assert read_table(path, names=["u", "sigma"], groups=slice(1, 9)).num_rows == 0
    (tmp_path / "cut.parquet").write_bytes(path.read_bytes()[:-9])
    assert "not a whole Parquet file" in refusal(read_table, tmp_path / "cut.parquet")
