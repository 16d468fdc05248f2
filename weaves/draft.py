"""Drafts: the yarn on top at every crossing of one repeat.

`warp_over[pick, end]` is True where the warp covers the weft. End i covers x in [i, i + 1), pick j covers y in
[j, j + 1): pick 0 is the lowest row of a drawn draft, so drawings (rows of text) list the picks from the last to the
first. A float is a run of cells, cyclic in the repeat, over which one yarn stays on top.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Literal, NamedTuple

import numpy as np
import numpy.typing as npt
from pydantic import Field, StrictBool, StrictInt, model_validator

from weaves.errors import BadInput
from weaves.validation import Frozen

LARGEST_REPEAT = 256  # most ends, and most picks, of a repeat

Bools = npt.NDArray[np.bool_]
Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Draft:
    """One repeat of a weave.

    `warp_over` (picks, ends) is True where the warp is on top; it is copied and made read-only. `name` is in weavers'
    terms, such as ``"twill 3/1"``; equality ignores it. BadInput if the matrix is empty, not two-dimensional, or larger
    than `LARGEST_REPEAT`.
    """

    warp_over: Bools
    name: str = "draft"

    def __post_init__(self) -> None:
        matrix = np.array(self.warp_over, dtype=np.bool_, order="C")
        if matrix.ndim != 2 or not 1 <= min(matrix.shape) <= max(matrix.shape) <= LARGEST_REPEAT:
            raise BadInput(self.name, "repeat", matrix.shape, f"(picks, ends), each from 1 to {LARGEST_REPEAT}")
        matrix.setflags(write=False)
        object.__setattr__(self, "warp_over", matrix)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Draft) and np.array_equal(self.warp_over, other.warp_over)

    def __hash__(self) -> int:
        return hash((self.warp_over.shape, self.warp_over.tobytes()))

    @property
    def repeat(self) -> tuple[int, int]:
        """Ends and picks of the repeat: its extent in x and in y."""
        picks, ends = self.warp_over.shape
        return ends, picks

    def rolled(self, ends: int, picks: int) -> Draft:
        """Return this cloth with the repeat shifted by `ends` to the left and `picks` down."""
        return Draft(np.roll(self.warp_over, (picks, ends), axis=(0, 1)), self.name)

    def rows(self) -> list[str]:
        """Return the drawing that `Matrix` reads."""
        return ["".join("#" if over else "." for over in pick) for pick in self.warp_over[::-1]]

    def text(self) -> str:
        """Return the drawdown for a terminal: two characters a cell, full for warp over, the last pick first."""
        return "\n".join(row.replace("#", "██").replace(".", "· ") for row in self.rows())

    def different_cells(self) -> int:
        """Return the number of orbits of cells under translations of the cloth onto itself; all are equally large."""
        return self.warp_over.size // len(translations(self.warp_over))

    def loom(self) -> Loom:
        """Return a loom that weaves it: equal ends have one shaft, equal picks one treadle, numbered as they appear."""
        threading, shafts = numbered([end.tobytes() for end in self.warp_over.T])
        treadling, treadles = numbered([pick.tobytes() for pick in self.warp_over])
        first = [threading.index(shaft) for shaft in range(len(shafts))]
        tie_up = self.warp_over[[treadling.index(treadle) for treadle in range(len(treadles))]][:, first]
        return Loom(
            threading=tuple(shaft + 1 for shaft in threading),
            tie_up=tuple(map(tuple, tie_up.astype(int).tolist())),
            treadling=tuple(treadle + 1 for treadle in treadling),
        )

    def hangs_together(self) -> bool:
        """Return whether no yarns lie loose on the others, so that the cloth does not come apart.

        The cloth hangs together if and only if the graph is strongly connected that has an arrow from the upper yarn to
        the lower one for each crossing [Clapham1980Fabric].
        """
        from scipy.sparse.csgraph import connected_components

        (ends, picks), over = self.repeat, self.warp_over.T
        arrows = np.block([[np.zeros((ends, ends), np.bool_), over], [~over.T, np.zeros((picks, picks))]])
        return bool(connected_components(arrows, connection="strong", return_labels=False) == 1)

    @lru_cache(maxsize=4096)  # noqa: B019, drafts are small and equal ones are often compared
    def canonical(self) -> tuple[tuple[int, int], bytes]:
        """Return a form that is equal for all shifts and mirror images of this cloth, and for no other cloth."""
        matrix = smallest_repeat(self.warp_over)
        picks, ends = matrix.shape
        images = (matrix, matrix[::-1], matrix[:, ::-1], matrix[::-1, ::-1])
        shifted = (np.lib.stride_tricks.sliding_window_view(np.tile(image, (2, 2)), (picks, ends)) for image in images)
        # One window at a time: all those of the largest repeat have a gigabyte.
        return (ends, picks), min(
            np.packbits(windows[pick, end]).tobytes() for windows in shifted for pick, end in np.ndindex(picks, ends)
        )


def translations(matrix: Bools) -> npt.NDArray[np.int64]:
    """Return the shifts by rows and columns that map a cyclic matrix onto itself, (n, 2), in order from (0, 0) on.

    All cells agree where the autocorrelation of their signs has its full value; each that does not lowers it by 2.
    """
    spectrum = np.fft.rfft2(np.where(matrix, 1.0, -1.0))
    agreement = np.fft.irfft2(spectrum * spectrum.conj(), matrix.shape)
    return np.argwhere(agreement > matrix.size - 1.0)


def numbered(rows: Sequence[Hashable]) -> tuple[list[int], list[Hashable]]:
    """Return a number for each row, equal for equal ones, counted from 0 as they appear; and the different rows."""
    different: dict[Hashable, int] = {}
    return [different.setdefault(row, len(different)) for row in rows], list(different)


class Cells(NamedTuple):
    """The floats that pass through every cell of a repeat; arrays (picks, ends)."""

    top: npt.NDArray[np.int8]  # the yarn on top: 0 warp, 1 weft
    top_offset: Floats  # cell centre minus centre of the float, along +y for a warp and +x for a weft, in cells
    top_length: Floats
    """Cells over which the yarn stays on top (beneath); infinite, with offset 0, if it never changes side."""
    under_offset: Floats
    under_length: Floats


def cells(draft: Draft) -> Cells:
    """Find the float on top and the float beneath in every cell."""
    over = draft.warp_over
    warp_length, warp_offset = _runs(over)
    weft_length, weft_offset = (runs.T for runs in _runs(over.T))
    top = np.where(over, warp_offset, weft_offset), np.where(over, warp_length, weft_length)
    under = np.where(over, weft_offset, warp_offset), np.where(over, weft_length, warp_length)
    return Cells(np.where(over, 0, 1).astype(np.int8), *top, *under)


def _runs(side: Bools) -> tuple[Floats, Floats]:
    """Measure the cyclic runs of equal values down the columns: length, and place from the middle of the run."""
    count, row = len(side), np.arange(2 * len(side))[:, None]
    begins = np.tile(side != np.roll(side, 1, axis=0), (2, 1))
    begin = np.maximum.accumulate(np.where(begins, row, -1))[count:]
    following = np.minimum.accumulate(np.where(begins, row, 2 * count)[::-1])[-2 : -count - 2 : -1]
    place = row[count:] - begin
    length = place + following - row[:count]
    changes = begins.any(axis=0)
    return np.where(changes, length, np.inf), np.where(changes, place - (length - 1) / 2, 0.0)


def smallest_repeat(matrix: Bools) -> Bools:
    """Cut a matrix to the smallest block that repeats in it."""
    for axis in (0, 1):
        matrix = matrix.take(range(smallest_period(matrix, axis)), axis)
    return matrix


def smallest_period(values: npt.NDArray[np.generic], axis: int = 0) -> int:
    """Return the smallest divisor of an axis's length after which the values repeat; 0 if there are none."""
    size = values.shape[axis]
    periods = (p for p in range(1, size + 1) if size % p == 0 and bool((np.roll(values, p, axis) == values).all()))
    return next(periods, 0)


class Family(Frozen):
    """Draft of a fabric file; each subclass is a weave family, or several."""

    family: str

    def build(self) -> Draft:
        """Weave the draft."""
        raise NotImplementedError

    @model_validator(mode="after")
    def _can_be_woven(self) -> Family:
        self.build()
        return self


class Matrix(Family):
    """Any draft, drawn."""

    family: Literal["matrix"] = "matrix"
    rows: tuple[str, ...] = Field(min_length=1, max_length=LARGEST_REPEAT)
    """The drawdown, last pick first: # for warp over, . for weft over."""

    def build(self) -> Draft:
        """Weave the drawn draft; BadInput if a row has other letters or another length than the first."""
        for row in self.rows:
            if not row or len(row) != len(self.rows[0]) or set(row) - set("#."):
                allowed = "rows of equal length are needed, of # (warp over) and . (weft over)"
                raise BadInput("matrix", "rows", row, allowed)
        return Draft(np.array([[letter == "#" for letter in row] for row in reversed(self.rows)]), "matrix")


class Loom(Family):
    """Any draft, as a loom is set up: pick j raises the shafts tied to its treadle, end i rises with its shaft."""

    family: Literal["loom"] = "loom"
    threading: tuple[StrictInt, ...] = Field(min_length=1)  # shaft of each end, from 1
    tie_up: tuple[Annotated[tuple[StrictBool | StrictInt, ...], Field(max_length=LARGEST_REPEAT)], ...] = Field(
        max_length=LARGEST_REPEAT
    )
    """One row per treadle: 1 for each shaft that it lifts, else 0."""
    treadling: tuple[StrictInt, ...] = Field(min_length=1)  # treadle of each pick, from 1

    def build(self) -> Draft:
        """Weave the draft of the loom; BadInput if a shaft or treadle does not exist."""
        shafts = len(self.tie_up[0]) if self.tie_up else 0
        if not shafts or any(len(treadle) != shafts for treadle in self.tie_up):
            allowed = "one row per treadle is needed, all with one entry per shaft"
            raise BadInput("loom", "tie_up", self.tie_up, allowed)
        for key, most in (("threading", shafts), ("treadling", len(self.tie_up))):
            chosen = getattr(self, key)
            if not all(1 <= number <= most for number in chosen):
                raise BadInput("loom", key, list(chosen), f"numbers from 1 to {most} are needed")
        lifted = np.array(self.tie_up, dtype=np.bool_)
        return Draft(lifted[np.array(self.treadling) - 1][:, np.array(self.threading) - 1], "loom")
