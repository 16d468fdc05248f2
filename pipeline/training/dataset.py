"""Training rows and their order.

All training rows of all fabrics are in memory. Which rows a step sees is a pure function of (seed, step): fabrics are
visited in rounds, each a new permutation of them; visit r of a fabric takes the r-th slice of its rows, permuted anew
in every epoch. A training that goes on after an interruption therefore sees the rows it would have seen.

    example   3 fabrics, 2 a step: rounds (2 0 1)(0 1 2)... give the steps (2 0), (1 0), (1 2), ...

More than `MOST_IN_MEMORY` rows are read from the shards when a step needs them, in windows of a few row groups. Every
epoch of a fabric visits its windows in a new order, and the rows of each in a new order. Rows are independent draws, so
that this order is as good as any; neither memory nor the time to the first step grows with them.
"""

from collections.abc import Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import IterableDataset, get_worker_info

from pipeline.compiled.arrays import Float32, Index
from pipeline.models.network import Batch
from pipeline.shards.manifest import Manifest, ShardEntry
from pipeline.shards.pieces import RowPiece
from pipeline.shards.schema import QUERY_COLUMNS
from pipeline.shards.store import ROW_GROUP, read_table
from pipeline.truth.conventions import COMPONENTS, TRANSPARENCY
from weaves.errors import BadInput

COLUMNS = 17  # u, v, sigma, wi (3), wo (3), sigma_minor, angle, curvature, components (4), transparency

TARGET = slice(12, 16)  # the columns of the components

_NAMES: Final = (*QUERY_COLUMNS, *COMPONENTS, TRANSPARENCY)

MOST_IN_MEMORY: Final = 2**23
"""Most rows that are read before the first step: a table of half a gigabyte, in some 4 s of one core."""

_MOST_GROUPS: Final = 8  # row groups of a window, 131,072 rows or 9 MB; fewer of many fabrics, so that all are kept
_MOST_PERMUTATIONS: Final = 512  # that are kept
_STARTS: Final = 64  # fabrics whose first rows the last bias starts at

_ROUND, _EPOCH, _STEP = 0, 1, 2  # purposes of the random streams


class TrainingRows:
    """The training rows of fabrics, whose order of names numbers them, in batches on a `device`.

    `windows` are the numbers of rows that are read together, of each fabric: all of them, if there are no more than
    `MOST_IN_MEMORY`. A GPU keeps rows of less than half of its free memory.
    """

    def __init__(self, manifest: Manifest, folder: Path, fabrics: Sequence[str], device: torch.device) -> None:
        shards = manifest.by_fabric(folder, fabrics, "train").values()
        total = sum(shard.rows for own in shards for shard in own)
        self._device, self._whole = device, total <= MOST_IN_MEMORY
        groups = min(max(MOST_IN_MEMORY // (ROW_GROUP * len(shards)), 1), _MOST_GROUPS)
        rows = total if self._whole else groups * ROW_GROUP
        self._pieces = [_windows(folder, own, rows) for own in shards]
        self.windows = [[sum(piece.rows for piece in window) for window in own] for own in self._pieces]
        self._window = lru_cache(maxsize=None if self._whole else MOST_IN_MEMORY // rows)(self._read)
        free = torch.cuda.mem_get_info(device)[0] if device.type == "cuda" else 0
        self._kept_on = device if self._whole and 4 * COLUMNS * total < free // 2 else torch.device("cpu")

    def take(self, fabrics: Index, rows: Index) -> Tensor:
        """Return rows (F, n) of fabrics (F,), counted within each fabric, (F, n, COLUMNS); of each from one window."""
        taken = []
        for fabric, own in zip(fabrics.tolist(), rows, strict=True):
            ends = np.cumsum(self.windows[fabric])
            window = int(np.searchsorted(ends, own[0], side="right"))
            first = ends[window] - self.windows[fabric][window]
            taken.append(self._window(fabric, window)[torch.from_numpy(own - first).to(self._kept_on)])
        return torch.stack(taken)

    def batch(self, fabrics: Index, rows: Index) -> Batch:
        """Return a step's rows, as those of `take`, as tensors on the device."""
        table = self.take(fabrics, rows).to(self._device)
        u, v, sigma = table[..., :3].unbind(dim=-1)
        minor, angle, curvature = table[..., 9:12].unbind(dim=-1)
        wi, wo, target = table[..., 3:6], table[..., 6:9], table[..., TARGET]
        fabric = torch.from_numpy(fabrics).to(self._device)
        return Batch(fabric, u, v, sigma, wi, wo, minor, angle, curvature, target, table[..., -1])

    def spread(self, most: int) -> Tensor:
        """Return about so many rows, evenly spaced; of rows in windows the first ones of some fabrics."""
        if not self._whole:
            some = self._pieces[:: -(-len(self._pieces) // _STARTS)]
            return torch.cat([torch.from_numpy(own[0][0].read(1)[: most // len(some)]) for own in some])
        starts = np.cumsum([0, *(count for (count,) in self.windows)])
        step = max(int(starts[-1]) // most, 1)
        return torch.cat([self._window(n, 0)[-start % step :: step] for n, start in enumerate(starts[:-1].tolist())])

    def _read(self, fabric: int, window: int) -> Tensor:
        parts = [piece.read() for piece in self._pieces[fabric][window]]
        return torch.from_numpy(np.concatenate(parts)).to(self._kept_on)


class _Piece(NamedTuple):
    """Consecutive row groups of a shard."""

    path: Path
    first: int
    """Number of the first group."""
    rows: int  # of all groups

    def read(self, groups: int = 0) -> Float32:
        """Return the rows of the first groups, 0: of all."""
        last = self.first + (groups or -(-self.rows // ROW_GROUP))
        table = read_table(self.path, names=_NAMES, groups=slice(self.first, last))
        return np.stack([column.to_numpy() for column in table.columns], axis=-1)


def _windows(folder: Path, shards: Sequence[ShardEntry], least: int) -> list[list[_Piece]]:
    """Cut the rows of a fabric into windows of at least so many rows, whole row groups, and not many more."""
    pieces = [
        _Piece(folder / shard.file, start // ROW_GROUP, min(least, shard.rows - start))
        for shard in shards
        for start in range(0, shard.rows, least)
    ]
    windows: list[list[_Piece]] = []
    left = sum(piece.rows for piece in pieces)
    window = 0  # rows of the last one
    for piece in pieces:
        if not windows or (window >= least and left >= least):
            windows.append([])
            window = 0
        windows[-1].append(piece)
        window, left = window + piece.rows, left - piece.rows
    return windows


class Order:
    """Which rows each step sees: a pure function of (seed, step).

    `windows` are the numbers of rows of each fabric's windows, which are shuffled one by one; a step sees `batch` rows
    of so many fabrics, no more than there are.
    """

    def __init__(self, windows: Sequence[Sequence[int]], batch: int, fabrics: int, seed: int) -> None:
        self._windows = [np.array(own) for own in windows]
        self.fabrics = min(fabrics, len(self._windows), batch)
        self.each = batch // self.fabrics
        self._seed = seed
        # A permutation is kept for the fabric's next visit.
        self._kept = lru_cache(maxsize=min(len(windows), _MOST_PERMUTATIONS))(self._permutation)

    def step(self, step: int) -> tuple[Index, Index]:
        """Return the fabrics (F,) of a step and their rows (F, n), counted within each fabric."""
        total = len(self._windows)
        visits = [divmod(place, total) for place in range(step * self.fabrics, (step + 1) * self.fabrics)]
        turns = {turn: self._permutation(total, _ROUND, turn, 0) for turn in {turn for turn, _ in visits}}
        chosen = np.array([turns[turn][place] for turn, place in visits])
        rows = [self._slice(int(fabric), turn) for fabric, (turn, _) in zip(chosen, visits, strict=True)]
        return chosen, np.stack(rows)

    def random(self, step: int) -> np.random.Generator:
        """Return the generator of everything else that is random in a step."""
        return self._generator(_STEP, step, 0)

    def _slice(self, fabric: int, visit: int) -> Index:
        """Return the rows of a fabric's `visit`; a window with fewer rows than wanted repeats them."""
        counts = self._windows[fabric]
        slices = np.maximum(counts // self.each, 1)
        epoch, part = divmod(visit, int(slices.sum()))
        if len(counts) == 1:
            return self._part(part, counts[0], _EPOCH, epoch, fabric)
        order = self._permutation(len(counts), _EPOCH, epoch, fabric)
        ends = np.cumsum(slices[order])
        turn = int(np.searchsorted(ends, part, side="right"))
        window = int(order[turn])
        part -= int(ends[turn] - slices[window])
        first = int(counts[:window].sum())
        return first + self._part(part, counts[window], _EPOCH, epoch, fabric, window)

    def _part(self, part: int, count: int, *purpose: int) -> Index:
        """Return a slice of the permutation of a window."""
        permutation = self._kept(count, *purpose)
        return np.resize(permutation[part * self.each : (part + 1) * self.each], self.each)

    def _permutation(self, count: int, *purpose: int) -> Index:
        return self._generator(*purpose).permutation(count)

    def _generator(self, *purpose: int) -> np.random.Generator:
        return np.random.Generator(np.random.Philox(np.random.SeedSequence((self._seed, *purpose))))


class RowStream(IterableDataset[dict[str, Tensor]]):
    """Batches of rows by column, with the number of their fabric in the column `fabric`, for other training loops.

    A piece of a file is read at a time, so memory does not grow with the data set. The order of pieces, and of the rows
    within one, is a pure function of the seed and of how often the stream was read before; worker processes count this
    anew when they start, so a DataLoader that has some needs ``persistent_workers=True``. `TrainingRows` mix fabrics
    better.

    The pieces come fabric after fabric; this order numbers the fabrics. A batch has at most `rows` rows, >= 1, of one
    piece. With the seed None the order is that of the pieces.
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
