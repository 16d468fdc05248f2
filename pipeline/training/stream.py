"""Rows of a data set as a stream of batches, for training loops other than ours.

A piece of a file is read at a time, so memory does not grow with the data set. The order of pieces, and of the rows
within one, is a pure function of the seed and of how often the stream was read before; worker processes count this anew
when they start, so a DataLoader that has some needs ``persistent_workers=True``. Our own loop mixes fabrics better
(`pipeline.training.dataset`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import IterableDataset, get_worker_info

from pipeline.shards.pieces import Piece
from weaves.errors import BadInput


class RowStream(IterableDataset[dict[str, Tensor]]):
    """Batches of rows by column, with the number of their fabric in the column `fabric`.

    Parameters
    ----------
    pieces : sequence of Piece
        The rows, fabric after fabric; this order numbers the fabrics.
    rows : int
        Most rows of a batch, >= 1; no batch has rows of two pieces.
    seed : int or None
        Seed of the order; None keeps that of the pieces.
    """

    def __init__(self, pieces: Sequence[Piece], rows: int = 4096, seed: int | None = 0) -> None:
        if rows < 1:
            raise BadInput("torch", "rows", rows, "must be at least 1")
        if seed is not None and seed < 0:
            raise BadInput("torch", "seed", seed, "must be at least 0, or None")
        self.fabrics = list(dict.fromkeys(piece.fabric for piece in pieces))
        """Names of the fabrics, by their numbers."""
        self._pieces, self._rows, self._seed = list(pieces), rows, seed
        self._passes = 0

    def __iter__(self) -> Iterator[dict[str, Tensor]]:
        """Yield all rows once; of several workers of a DataLoader each yields those of its pieces."""
        random = np.random.default_rng((self._seed, self._passes)) if self._seed is not None else None
        self._passes += 1
        order = random.permutation(len(self._pieces)) if random else np.arange(len(self._pieces))
        worker = get_worker_info()
        for place, index in enumerate(order.tolist()):
            piece = self._pieces[index]
            shuffled = random.permutation(piece.rows) if random else np.arange(piece.rows)
            if worker is not None and place % worker.num_workers != worker.id:
                continue
            columns, number = piece.read(), self.fabrics.index(piece.fabric)
            for start in range(0, piece.rows, self._rows):
                chosen = shuffled[start : start + self._rows]
                batch = {name: torch.from_numpy(values[chosen]) for name, values in columns.items()}
                yield {"fabric": torch.full((len(chosen),), number), **batch}
