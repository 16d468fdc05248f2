"""Standard position: one representative of all shifts, mirror images and turns of a cloth.

A repeat may begin at any yarn; the mirror image of a fabric is a fabric, and so is one with warp and weft exchanged by
the mirror x = y. The answers for these fabrics follow from those for the first: the mirrors x -> -x, y -> -y and x = y
generate the eight symmetries of the square, each mirror reverses the twist, and the exchange swaps the components of
warp and weft. A network that sees each cloth in one standard position only, its queries moved with it, obeys all this
exactly, and need not spend weights, rows and time on learning it. Only the symmetries that a cloth itself has, which
leave its standard position as it is, remain to be learnt.

Standard is the position whose draft, read pick by pick, is the smallest binary number (True = warp over = 1); among
equals the one with the smallest numbers of its warp, then of its weft.
"""

from typing import Final, NamedTuple

import numpy as np
import torch
from torch import Tensor

from pipeline.models.domain import YARN_NUMBERS
from weaves.draft import Draft, Matrix
from weaves.fabric import Fabric


class Symmetry(NamedTuple):
    """Mirrors applied one after the other."""

    mirror_x: bool  # x becomes -x
    mirror_y: bool  # y becomes -y
    exchange: bool  # x and y change places, and with them warp and weft; after the other two


SYMMETRIES: Final = tuple(Symmetry(bool(i & 1), bool(i & 2), bool(i & 4)) for i in range(8))
"""All eight; the first changes nothing."""


class Placement(NamedTuple):
    """Transformations that bring F fabrics into standard position."""

    mirror: Tensor  # mirrors of x and of y, bool (F, 2)
    exchange: Tensor  # true if x and y change places afterwards, bool (F, 1)
    start: Tensor  # start of the standard repeat after that, as shares of it, float (F, 2)
    repeat: Tensor  # extent of the standard repeat in x and y, in yarn spacings, float (F, 2)

    def move(self, u: Tensor, v: Tensor) -> tuple[Tensor, Tensor]:
        """Return places u and v (F, n), shares of each fabric's own repeat, as shares in [0, 1) of the standard one."""
        sign = 1.0 - 2.0 * self.mirror
        u, v = u * sign[:, :1], v * sign[:, 1:]
        x = torch.where(self.exchange, v, u) - self.start[:, :1]
        y = torch.where(self.exchange, u, v) - self.start[:, 1:]
        return _share(x), _share(y)

    def turn(self, directions: Tensor) -> Tensor:
        """Return directions (F, n, 3) about the fabrics in standard position."""
        sign = torch.cat([1.0 - 2.0 * self.mirror, torch.ones_like(self.start[:, :1])], dim=-1).unsqueeze(1)
        turned = directions * sign
        return torch.where(self.exchange.unsqueeze(-1), turned[..., [1, 0, 2]], turned)

    def swap(self, components: Tensor) -> Tensor:
        """Take components (F, n, 4) from a fabric to its standard position, or back."""
        return torch.where(self.exchange.unsqueeze(-1), components[..., [1, 0, 3, 2]], components)

    def own_repeat(self) -> Tensor:
        """Return the extents of the fabrics' own repeats, (F, 2)."""
        return torch.where(self.exchange, self.repeat.flip(-1), self.repeat)


def standard(fabric: Fabric) -> tuple[Fabric, Symmetry, tuple[int, int]]:
    """Bring a fabric into standard position; return it, the symmetry applied first, and its first end and pick."""
    best = min((*_smallest(moved(fabric, symmetry)), symmetry) for symmetry in SYMMETRIES)
    *_, (pick, end), symmetry = best
    return begun_at(moved(fabric, symmetry), (end, pick)), symmetry, (end, pick)


def begun_at(fabric: Fabric, start: tuple[int, int]) -> Fabric:
    """Return a fabric whose repeat begins at the end and pick of `start`."""
    end, pick = start
    return _with_draft(fabric, fabric.weave.rolled(-end, -pick).warp_over)


def moved(fabric: Fabric, symmetry: Symmetry) -> Fabric:
    """Return the fabric that a symmetry makes of a fabric; its repeat begins where the old one's image does."""
    matrix, warp, weft = fabric.weave.warp_over, fabric.warp, fabric.weft
    matrix = matrix[:, ::-1] if symmetry.mirror_x else matrix
    matrix = matrix[::-1] if symmetry.mirror_y else matrix
    if symmetry.exchange:
        matrix, warp, weft = ~matrix.T, weft, warp
    if sum(symmetry) % 2:
        warp, weft = (yarn.model_copy(update={"twist": -yarn.twist}) for yarn in (warp, weft))
    return _with_draft(fabric.model_copy(update={"warp": warp, "weft": weft}), matrix)


def placement(fabric: Fabric, symmetry: Symmetry, start: tuple[int, int]) -> Placement:
    """Return the placement of one fabric, F = 1, that `standard` found."""
    ends, picks = fabric.weave.repeat
    repeat = (picks, ends) if symmetry.exchange else (ends, picks)
    return Placement(
        mirror=torch.tensor([[symmetry.mirror_x, symmetry.mirror_y]]),
        exchange=torch.tensor([[symmetry.exchange]]),
        start=torch.tensor([[start[0] / repeat[0], start[1] / repeat[1]]]),
        repeat=torch.tensor([repeat], dtype=torch.float32),
    )


def _smallest(fabric: Fabric) -> tuple[bytes, list[float], tuple[int, int]]:
    """Return the smallest draft among all beginnings, the yarns' numbers, and pick and end where it begins."""
    matrix = fabric.weave.warp_over
    picks, ends = matrix.shape
    windows = np.lib.stride_tricks.sliding_window_view(np.tile(matrix, (2, 2)), matrix.shape)[:picks, :ends]
    numbers = np.packbits(windows.reshape(picks * ends, -1), axis=-1)
    index = min(range(picks * ends), key=lambda row: numbers[row].tobytes())
    of_yarns = [float(getattr(yarn, name)) for yarn in (fabric.warp, fabric.weft) for name in YARN_NUMBERS]
    return numbers[index].tobytes(), of_yarns, divmod(index, ends)


def _with_draft(fabric: Fabric, matrix: np.typing.NDArray[np.bool_]) -> Fabric:
    return fabric.model_copy(update={"draft": Matrix(rows=tuple(Draft(matrix).rows()))})


def _share(x: Tensor) -> Tensor:
    """Reduce to [0, 1); rounding can reach 1, which periodic encodings do not mind and plain ones see as the edge."""
    return x - x.floor()
