"""Rows about the silhouette as tensors: training data of the opacity of a curved cloth."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn


class View(NamedTuple):
    """Footprints, viewers and curvatures of n queries.

    Attributes
    ----------
    u, v : Tensor (n,)
        Centres, in repeats.
    sigma : Tensor (n,)
        Footprints, in yarn spacings.
    wo : Tensor (n, 3)
        To the viewer.
    curvature : Tensor (n,)
        In the viewer's plane, 1/yarn spacings.
    """

    u: Tensor
    v: Tensor
    sigma: Tensor
    wo: Tensor
    curvature: Tensor


class Silhouettes(nn.Module):
    """Queries about the silhouette and their answers; no part of a trained model.

    Parameters
    ----------
    view : View
        The queries.
    target : Tensor (n, 2)
        Opacity and 0; or mean and variance of the grazing cosine, in units of sqrt(kappa) and kappa.
    """

    def __init__(self, view: View, target: Tensor) -> None:
        super().__init__()
        for name, column in zip(View._fields, view, strict=True):
            self.register_buffer(name, column, persistent=False)
        self.register_buffer("target", target, persistent=False)

    def draw(self, count: int, random: np.random.Generator) -> tuple[View, Tensor]:
        """Return `count` random queries and their answers."""
        rows = torch.from_numpy(random.integers(0, len(self.get_buffer("u")), count)).to(self.get_buffer("u").device)
        return View(*(self.get_buffer(name)[rows] for name in View._fields)), self.get_buffer("target")[rows]


def silhouettes_of(columns: Mapping[str, npt.NDArray[Any]], repeat: tuple[int, int]) -> Silhouettes:
    """Return rows of kind `opacity` or `grazing_cosine` (`pipeline.shards.silhouettes`) for a training."""
    ends, picks = repeat
    wo = np.stack([columns["wo_x"], columns["wo_y"], columns["wo_z"]], axis=-1)
    view = (columns["u"] / ends, columns["v"] / picks, columns["sigma"], wo, columns["curvature"])
    if "opacity" in columns:
        target = [columns["opacity"], np.zeros_like(columns["opacity"])]
    else:
        target = [columns["grazing_mean"], columns["grazing_variance"]]
    tensors = (torch.from_numpy(np.array(column, np.float32)) for column in (*view, np.stack(target, axis=-1)))
    *read, answers = tensors
    return Silhouettes(View(*read), answers)
