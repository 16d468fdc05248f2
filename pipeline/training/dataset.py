"""Training rows and their order.

All training rows of all fabrics lie in one memory-mapped float32 table, fabric after fabric. Which rows a step sees
is a pure function of (seed, step): fabrics are visited in rounds, each a new permutation of them; visit r of a fabric
takes the r-th slice of its rows, permuted anew in every epoch. A training that goes on after an interruption
therefore sees the rows it would have seen.

    example   3 fabrics, 2 a step: rounds (2 0 1)(0 1 2)... give the steps (2 0), (1 0), (1 2), ...
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor
from torch.utils.data import IterableDataset, get_worker_info

from pipeline.atomic import atomic_path
from pipeline.models.network import Batch
from pipeline.shards.manifest import Manifest, ShardEntry
from pipeline.shards.pieces import RowPiece
from pipeline.shards.schema import QUERY_COLUMNS
from pipeline.shards.store import read_table
from pipeline.truth.conventions import COMPONENTS, TRANSPARENCY
from weaves.errors import BadInput

COLUMNS = 17
"""u, v, sigma, wi (3), wo (3), sigma_minor, angle, curvature, components (4), transparency."""

TARGET = slice(12, 16)
"""The columns of the components."""

_NAMES: Final = (*QUERY_COLUMNS, *COMPONENTS, TRANSPARENCY)

_READERS: Final = 4  # shards that are read at the same time

_ROUND, _EPOCH, _STEP = 0, 1, 2  # purposes of the random streams


class TrainingRows:
    """A table of rows (rows, COLUMNS), fabric after fabric, `counts` of each, at least 1; it may be memory-mapped."""

    def __init__(self, table: npt.NDArray[np.float32], counts: Sequence[int]) -> None:
        self.table, self.counts = table, list(counts)
        self.starts = np.concatenate([[0], np.cumsum(self.counts)])


def load_rows(manifest: Manifest, folder: Path, fabrics: Sequence[str], cache: Path) -> TrainingRows:
    """Return the training rows of fabrics, mapped from `cache`, which is written anew: an older one may be damaged.

    The order of the fabrics' names numbers them. The caller names the cache, a ``.npy`` file, after what it holds and
    deletes it in the end.
    """
    by_fabric = manifest.by_fabric(folder, fabrics, "train")
    counts = [sum(part.rows for part in by_fabric[name]) for name in fabrics]
    with atomic_path(cache, durable=False) as temporary:  # no later process reads it
        shape = (sum(counts), COLUMNS)
        table = np.lib.format.open_memmap(temporary, mode="w+", dtype=np.float32, shape=shape)
        parts = [part for name in fabrics for part in by_fabric[name]]
        starts = np.cumsum([0, *(part.rows for part in parts)])

        def fill(part: ShardEntry, start: int) -> None:
            columns = read_table(folder / part.file, names=_NAMES)
            table[start : start + part.rows] = np.stack([column.to_numpy() for column in columns.columns], axis=-1)

        with ThreadPoolExecutor(_READERS) as pool:  # one shard of each is in memory
            for _ in pool.map(fill, parts, starts):
                pass
    return TrainingRows(np.load(cache, mmap_mode="r"), counts)


class Order:
    """Which rows each step sees: a pure function of (seed, step).

    `counts` are the rows of each fabric; a step sees `batch` rows of so many fabrics, no more than there are.
    """

    def __init__(self, counts: Sequence[int], batch: int, fabrics: int, seed: int) -> None:
        self.counts = list(counts)
        self.fabrics = min(fabrics, len(self.counts), batch)
        self.each = batch // self.fabrics
        self._seed = seed
        self._epochs: dict[int, tuple[int, npt.NDArray[np.int64]]] = {}  # the last permutation of each fabric

    def step(self, step: int) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """Return the fabrics (F,) of a step and their rows (F, n), counted within each fabric."""
        total = len(self.counts)
        visits = [divmod(place, total) for place in range(step * self.fabrics, (step + 1) * self.fabrics)]
        turns = {turn: self._permutation(total, _ROUND, turn, 0) for turn in {turn for turn, _ in visits}}
        chosen = np.array([turns[turn][place] for turn, place in visits])
        rows = [self._slice(int(fabric), turn) for fabric, (turn, _) in zip(chosen, visits, strict=True)]
        return chosen, np.stack(rows)

    def random(self, step: int) -> np.random.Generator:
        """Return the generator of everything else that is random in a step."""
        return self._generator(_STEP, step, 0)

    def _slice(self, fabric: int, visit: int) -> npt.NDArray[np.int64]:
        """Return the rows of a fabric's `visit`; a fabric with fewer rows than wanted repeats them."""
        count = self.counts[fabric]
        slices = max(count // self.each, 1)
        epoch, part = divmod(visit, slices)
        if self._epochs.get(fabric, (-1,))[0] != epoch:
            self._epochs[fabric] = epoch, self._permutation(count, _EPOCH, epoch, fabric)
        permutation = self._epochs[fabric][1]
        return np.resize(permutation[part * self.each : (part + 1) * self.each], self.each)

    def _permutation(self, count: int, purpose: int, index: int, of: int) -> npt.NDArray[np.int64]:
        return self._generator(purpose, index, of).permutation(count)

    def _generator(self, purpose: int, index: int, of: int) -> np.random.Generator:
        return np.random.Generator(np.random.Philox(np.random.SeedSequence((self._seed, purpose, index, of))))


class Batches:
    """Batches of a training, in an order, as tensors on one device.

    A GPU holds the whole table if it takes less than half of the free memory.
    """

    def __init__(self, rows: TrainingRows, order: Order, device: torch.device) -> None:
        self.rows, self.order, self.device = rows, order, device
        self._resident: Tensor | None = None
        if device.type == "cuda" and rows.table.nbytes < torch.cuda.mem_get_info(device)[0] // 2:
            self._resident = torch.from_numpy(np.array(rows.table)).to(device)

    def step(self, step: int) -> Batch:
        """Return the batch of a step."""
        fabrics, rows = self.order.step(step)
        index = rows + self.rows.starts[fabrics][:, None]
        if self._resident is not None:
            table = self._resident[torch.from_numpy(index).to(self.device)]
        else:
            table = torch.from_numpy(self.rows.table[index]).to(self.device)
        u, v, sigma = table[..., :3].unbind(dim=-1)
        minor, angle, curvature = table[..., 9:12].unbind(dim=-1)
        wi, wo, target = table[..., 3:6], table[..., 6:9], table[..., TARGET]
        fabric = torch.from_numpy(fabrics).to(self.device)
        return Batch(fabric, u, v, sigma, wi, wo, minor, angle, curvature, target, table[..., -1])


class RowStream(IterableDataset[dict[str, Tensor]]):
    """Batches of rows by column, with the number of their fabric in the column `fabric`, for other training loops.

    A piece of a file is read at a time, so memory does not grow with the data set. The order of pieces, and of the rows
    within one, is a pure function of the seed and of how often the stream was read before; worker processes count this
    anew when they start, so a DataLoader that has some needs ``persistent_workers=True``. `Batches` mix fabrics better.

    Parameters
    ----------
    pieces : sequence of RowPiece
        The rows, fabric after fabric; this order numbers the fabrics.
    rows : int
        Most rows of a batch, >= 1; no batch has rows of two pieces.
    seed : int or None
        Seed of the order; None keeps that of the pieces.
    """

    def __init__(self, pieces: Sequence[RowPiece], rows: int = 4096, seed: int | None = 0) -> None:
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
