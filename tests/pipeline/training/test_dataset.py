import numpy as np
import pytest
import torch
from torch.utils.data import DataLoader

from pipeline.shards.manifest import Manifest
from pipeline.shards.pieces import DatasetRows
from pipeline.training.dataset import COLUMNS, Batches, Order, RowStream, TrainingRows, load_rows
from pipeline.truth.query import Answers, Queries
from tests.datasets import write_dataset
from weaves.errors import BadInput


def test_order_is_a_function_of_seed_and_step():
    forwards = Order([100, 50, 70], batch=32, fabrics=2, seed=7)
    steps = [forwards.step(step) for step in range(40)]
    for step in (39, 0, 17):  # another order of asking, another object
        fabrics, rows = Order([100, 50, 70], batch=32, fabrics=2, seed=7).step(step)
        np.testing.assert_array_equal(fabrics, steps[step][0])
        np.testing.assert_array_equal(rows, steps[step][1])
    assert not np.array_equal(Order([100, 50, 70], 32, 2, seed=8).step(0)[1], steps[0][1])


def test_every_round_visits_every_fabric_and_every_epoch_every_row_once():
    order = Order([64] * 5, batch=10, fabrics=5, seed=1)
    for step in range(8):
        assert sorted(order.step(step)[0]) == [0, 1, 2, 3, 4]
    order = Order([48, 48], batch=32, fabrics=2, seed=1)
    epochs = []
    for epoch in range(3):
        seen = {0: [], 1: []}
        for step in range(3 * epoch, 3 * epoch + 3):
            for fabric, rows in zip(*order.step(step), strict=True):
                seen[int(fabric)].extend(rows.tolist())
        assert sorted(seen[0]) == sorted(seen[1]) == list(range(48))
        epochs += seen.values()
    assert len(set(map(tuple, epochs))) == 6


def test_few_rows_are_repeated_and_no_more_fabrics_taken_than_there_are():
    assert sorted(np.bincount(Order([3], batch=8, fabrics=1, seed=0).step(0)[1][0])) == [2, 3, 3]
    order = Order([10, 10], batch=9, fabrics=8, seed=0)
    assert (order.fabrics, order.each) == (2, 4)


def test_batches_hold_the_rows_of_their_fabrics():
    """Each row holds its fabric in column 0 and its number within the fabric in column 1."""
    counts = [30, 20, 40]
    table = np.zeros((90, COLUMNS), np.float32)
    table[:, 0], table[:, 1] = np.repeat(range(3), counts), np.concatenate([np.arange(count) for count in counts])
    order = Order(counts, batch=12, fabrics=2, seed=3)
    batch = Batches(TrainingRows(table, counts), order, torch.device("cpu")).step(5)
    fabrics, numbers = order.step(5)
    np.testing.assert_array_equal(batch.fabric, fabrics)
    np.testing.assert_array_equal(batch.u, np.repeat(fabrics[:, None], 6, axis=1))
    np.testing.assert_array_equal(batch.v, numbers)


def test_columns_are_where_batches_look_for_them(tmp_path):
    numbers = np.split(np.arange(17, dtype=np.float32)[None], [1, 2, 3, 6, 9, 10, 11, 12, 16], axis=1)
    *columns, mean, transparency = (part[0] if part.size == 1 else part for part in numbers)
    queries = Queries(*columns)
    answers = Answers.opaque(mean, np.zeros((1, 4), np.float32), np.ones(1, np.int32))
    answers = answers._replace(transparency=transparency)
    write_dataset(tmp_path, {"seen": ["denim"]}, [("denim", "train", 0, queries, answers)])
    rows = load_rows(Manifest.load(tmp_path), tmp_path, ["denim"], tmp_path / "rows.npy")
    np.testing.assert_array_equal(rows.table, np.arange(17)[None])
    batch = Batches(rows, Order([1], batch=1, fabrics=1, seed=0), torch.device("cpu")).step(0)
    for name in Queries._fields:
        np.testing.assert_array_equal(getattr(batch, name)[0], getattr(queries, name))
    np.testing.assert_array_equal(batch.target[0], answers.mean)
    assert batch.transparency.item() == 16


NAMES = ["cotton_twill", "polyester_lining"]
ROWS = 4096


def stream(folder, split="train", names=NAMES, **rest):
    return RowStream(DatasetRows.load(folder).of(split, names), **rest)


def rows_in(batches):
    columns = ("fabric", "u", "v", "sigma", "diffuse_weft")
    return [row for batch in batches for row in zip(*(batch[name].tolist() for name in columns), strict=True)]


def expected(folder, split="train"):
    found = []
    for number, name in enumerate(NAMES):
        queries, answers = Manifest.load(folder).read(folder, name, split)
        columns = queries.u, queries.v, queries.sigma, answers.mean[:, 3]
        found += [(number, *row) for row in zip(*(column.tolist() for column in columns), strict=True)]
    return found


@pytest.mark.parametrize("rows", [1, 100, 4095, 10_000])
def test_every_row_comes_once(rows, folder):
    batches = list(stream(folder, "validation", rows=rows))
    assert sorted(rows_in(batches)) == sorted(expected(folder, "validation"))
    assert max(len(batch["u"]) for batch in batches) == min(rows, 512)


def test_the_order_is_that_of_the_files_or_of_the_seed_and_changes_with_each_pass(folder):
    assert rows_in(stream(folder, seed=None, rows=1000)) == expected(folder)
    one, other = stream(folder, seed=3), stream(folder, seed=4)
    first, second = rows_in(one), rows_in(one)
    assert first != second and sorted(first) == sorted(second)
    assert rows_in(stream(folder, seed=3)) == first != rows_in(other)
    workers = DataLoader(stream(folder, seed=None), batch_size=None, num_workers=2)
    assert sorted(rows_in(workers)) == sorted(expected(folder))


def test_rows_are_shuffled_well_within_a_shard(folder):
    """The mean place of the first half of a shard's rows is that of all, within 5 standard errors."""
    (batch,) = stream(folder, names=NAMES[:1], rows=ROWS)
    order = {u: place for place, u in enumerate(Manifest.load(folder).read(folder, NAMES[0], "train")[0].u.tolist())}
    places = np.array([order[u] for u in batch["u"].tolist()])
    assert abs(places[: ROWS // 2].mean() - (ROWS - 1) / 2) < 5 * ROWS / np.sqrt(12 * ROWS / 2)


def test_columns_are_tensors_of_their_own_type(folder):
    batch = next(iter(stream(folder, rows=7)))
    others = {name: values.dtype for name, values in batch.items() if values.dtype != torch.float32}
    assert others == {"fabric": torch.int64, "count": torch.int32}
    assert {len(values) for values in batch.values()} == {7}


@pytest.mark.parametrize(("options", "sentence"), [({"rows": 0}, "rows = 0"), ({"seed": -1}, "seed = -1")])
def test_bad_options_are_one_sentence(options, sentence, folder):
    with pytest.raises(BadInput, match=sentence):
        stream(folder, **options)
