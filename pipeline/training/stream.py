"""Rows of a data set as a stream of batches, for training loops other than ours.

A shard at a time is read, so memory does not grow with the data set. The order of shards, and of the rows within one,
is a pure function of the seed and of how often the stream was read before; worker processes count this anew when they
start, so a DataLoader that has some needs ``persistent_workers=True``. Our own loop mixes fabrics better
(`pipeline.training.dataset`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import IterableDataset, get_worker_info

from pipeline.shards.manifest import Manifest, Split
from pipeline.shards.store import read_columns
from weaves.errors import BadInput


class RowStream(IterableDataset[dict[str, Tensor]]):
    """Batches of rows by column, with the number of their fabric in the column `fabric`.

    Parameters
    ----------
    manifest, folder : Manifest, Path
        The data set.
    split : str
        train, validation or test.
    fabrics : sequence of str
        Names; their order numbers them.
    rows : int
        Most rows of a batch, >= 1; no batch has rows of two shards.
    seed : int or None
        Seed of the order; None keeps that of the files.
    """

    def __init__(
        self,
        manifest: Manifest,
        folder: Path,
        split: Split,
        fabrics: Sequence[str],
        rows: int = 4096,
        seed: int | None = 0,
    ) -> None:
        if rows < 1:
            raise BadInput(str(folder), "rows", rows, "must be at least 1")
        if seed is not None and seed < 0:
            raise BadInput(str(folder), "seed", seed, "must be at least 0, or None")
        self.fabrics = list(fabrics)
        self._numbers = {name: number for number, name in enumerate(fabrics)}
        shards = [shard for shard in manifest.shards if shard.split == split and shard.fabric in self._numbers]
        self._shards = sorted(shards, key=lambda shard: (self._numbers[shard.fabric], shard.start))
        self._folder, self._rows, self._seed = folder, rows, seed
        self._passes = 0

    def __iter__(self) -> Iterator[dict[str, Tensor]]:
        """Yield all rows once; of several workers of a DataLoader each yields those of its shards."""
        random = np.random.default_rng((self._seed, self._passes)) if self._seed is not None else None
        self._passes += 1
        order = random.permutation(len(self._shards)) if random else np.arange(len(self._shards))
        worker = get_worker_info()
        for place, index in enumerate(order.tolist()):
            shard = self._shards[index]
            shuffled = random.permutation(shard.rows) if random else np.arange(shard.rows)
            if worker is not None and place % worker.num_workers != worker.id:
                continue
            columns = read_columns(self._folder / shard.file, shard.kind)
            for start in range(0, shard.rows, self._rows):
                chosen = shuffled[start : start + self._rows]
                batch = {name: torch.from_numpy(values[chosen]) for name, values in columns.items()}
                yield {"fabric": torch.full((len(chosen),), self._numbers[shard.fabric]), **batch}
