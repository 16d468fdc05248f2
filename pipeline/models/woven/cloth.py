"""Inputs of `woven` from a cloth: maps of normal and tangent over one repeat, and the yarns' parameters.

Every cloth is brought into standard position first (pipeline.models.woven.standard_position), and begins at a random
yarn in every training step: both are options.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from pipeline.models.woven.options import WovenOptions
from pipeline.models.woven.standard_position import SYMMETRIES, Placement, moved, placement, standard
from weaves.draft import Matrix
from weaves.fabric import Fabric
from weaves.surface import surface_at


def parameter_count(options: WovenOptions) -> int:
    """Return how many parameters a fabric has beside its maps."""
    return 7 if options.transmission else 4


class WovenInputs(NamedTuple):
    """Inputs of the network from F fabrics, in standard position.

    Attributes
    ----------
    maps : Tensor (F, 6, side, side)
        Ply normal and fibre tangent at texel centres over one repeat; row = y, column = x.
    parameters : Tensor (F, 4 or 7)
        alpha_warp, alpha_weft, beta_warp, beta_weft; with `transmission` both widths and the optical thickness.
    placement : Placement
        Transformation of queries into standard position.
    """

    maps: Tensor
    parameters: Tensor
    placement: Placement

    def take(self, index: Tensor) -> WovenInputs:
        """Return the fabrics at `index`."""
        return WovenInputs(
            self.maps[index], self.parameters[index], Placement(*(part[index] for part in self.placement))
        )

    def begun(self, shares: npt.NDArray[np.float64]) -> WovenInputs:
        """Return the same cloth, each repeat begun elsewhere: `shares` (F, 2) of it to the left and downwards.

        Queries follow exactly, maps to the nearest texel.
        """
        texels = np.rint(shares * self.maps.shape[-1]).astype(np.int64).tolist()
        maps = [
            torch.roll(one, (down, right), dims=(1, 2)) for one, (right, down) in zip(self.maps, texels, strict=True)
        ]
        start = self.placement.start - torch.from_numpy(shares.astype(np.float32)).to(self.maps.device)
        return WovenInputs(torch.stack(maps), self.parameters, self.placement._replace(start=start))

    def to(self, device: torch.device) -> WovenInputs:
        """Return the same on a device."""
        parts = (part.to(device) for part in self.placement)
        return WovenInputs(self.maps.to(device), self.parameters.to(device), Placement(*parts))


def read_cloth(fabrics: Sequence[Fabric], options: WovenOptions, like: Fabric | None = None) -> WovenInputs:
    """Return the inputs of at least one fabric.

    Parameters
    ----------
    fabrics : sequence of Fabric
        At least one.
    options : WovenOptions
        Whether fabrics are brought into standard position, and the side of their maps.
    like : Fabric, optional
        All are mirrored, exchanged and begun as brings this one into standard position; otherwise each by itself.
    """
    centre = (np.arange(options.map_texels) + 0.5) / options.map_texels
    maps, parameters, placements = [], [], []
    for fabric in fabrics:
        seen, symmetry, start = fabric, SYMMETRIES[0], (0, 0)
        if options.standard:
            seen, symmetry, start = standard(like or fabric)
            seen = seen if like is None else _begun_at(moved(fabric, symmetry), start)
        ends, picks = seen.weave.repeat
        surface = surface_at(seen, centre[None, :] * ends, centre[:, None] * picks)
        maps.append(np.concatenate([surface.normal, surface.tangent], axis=-1).transpose(2, 0, 1))
        numbers = [seen.warp.roughness, seen.weft.roughness, seen.warp.relief, seen.weft.relief]
        more = [seen.warp.width, seen.weft.width, seen.optical_thickness / 2.0]
        parameters.append(numbers + (more if options.transmission else []))
        placements.append(placement(fabric, symmetry, start))
    together = Placement(*(torch.cat(parts) for parts in zip(*placements, strict=True)))
    return WovenInputs(torch.from_numpy(np.array(maps, np.float32)), torch.tensor(parameters), together)


def _begun_at(fabric: Fabric, start: tuple[int, int]) -> Fabric:
    """Return a fabric whose repeat begins at the end and pick of `start`."""
    end, pick = start
    return fabric.model_copy(update={"draft": Matrix(rows=tuple(fabric.weave.rolled(-end, -pick).rows()))})
