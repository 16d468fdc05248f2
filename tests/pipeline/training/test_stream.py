"""The stream of rows for other training loops: every row once, in an order that the seed decides."""

import numpy as np
import pytest
import torch
from torch.utils.data import DataLoader

from pipeline.shards.manifest import Manifest
from pipeline.shards.pieces import DatasetRows
from pipeline.training.stream import RowStream
from weaves.errors import BadInput

NAMES = ["cotton_twill", "polyester_lining"]
ROWS = 4096


def stream(folder, split="train", names=NAMES, **rest):
    return RowStream(DatasetRows.load(folder).of(split, names), **rest)


def rows_of(batches):
    """Return the rows that batches hold as tuples."""
    columns = ("fabric", "u", "v", "sigma", "diffuse_weft")
    return [row for batch in batches for row in zip(*(batch[name].tolist() for name in columns), strict=True)]


def expected(folder, split="train"):
    found = []
    for number, name in enumerate(NAMES):
        queries, answers = Manifest.load(folder).read(folder, name, split)
        columns = queries.u, queries.v, queries.sigma, answers.mean[:, 3]
        found += [(number, *row) for row in zip(*(column.tolist() for column in columns), strict=True)]
    return found


def test_without_a_seed_rows_have_the_order_of_the_files(folder):
    assert rows_of(stream(folder, seed=None, rows=1000)) == expected(folder)


@pytest.mark.parametrize("rows", [1, 100, 4095, 10_000])
def test_every_row_comes_once(rows, folder):
    batches = list(stream(folder, "validation", rows=rows))
    assert sorted(rows_of(batches)) == sorted(expected(folder, "validation"))
    assert max(len(batch["u"]) for batch in batches) == min(rows, 512)


def test_the_order_is_that_of_the_seed_and_changes_with_each_pass(folder):
    one, other = stream(folder, seed=3), stream(folder, seed=4)
    first, second = rows_of(one), rows_of(one)
    assert first != second and sorted(first) == sorted(second)
    assert rows_of(stream(folder, seed=3)) == first != rows_of(other)


def test_rows_are_shuffled_well_within_a_shard(folder):
    """The mean place of the first half of a shard's rows is that of all, within 5 standard errors."""
    (batch,) = stream(folder, names=NAMES[:1], rows=ROWS)
    order = {u: place for place, u in enumerate(Manifest.load(folder).read(folder, NAMES[0], "train")[0].u.tolist())}
    places = np.array([order[u] for u in batch["u"].tolist()])
    assert abs(places[: ROWS // 2].mean() - (ROWS - 1) / 2) < 5 * ROWS / np.sqrt(12 * ROWS / 2)


def test_workers_of_a_loader_share_the_shards(folder):
    loader = DataLoader(stream(folder, seed=None), batch_size=None, num_workers=2)
    assert sorted(rows_of(loader)) == sorted(expected(folder))


def test_columns_are_tensors_of_their_own_type(folder):
    batch = next(iter(stream(folder, rows=7)))
    assert {name: values.dtype for name, values in batch.items() if values.dtype != torch.float32} == {
        "fabric": torch.int64,
        "count": torch.int32,
    }
    assert {len(values) for values in batch.values()} == {7}


@pytest.mark.parametrize(("options", "sentence"), [({"rows": 0}, "rows = 0"), ({"seed": -1}, "seed = -1")])
def test_bad_options_are_one_sentence(options, sentence, folder):
    with pytest.raises(BadInput, match=sentence):
        stream(folder, **options)
