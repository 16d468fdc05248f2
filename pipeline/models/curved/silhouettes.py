"""Questions about silhouettes with the truth's answers: what the opacity of a curved cloth is learnt from.

A shard's transparency is what goes straight through the cloth at the points that the viewer sees. What misses a curved
cloth altogether is `pipeline.truth.geometry.opacity.opacity`, or the cosine at which a ray just touches; both vary near
grazing views alone, so that their questions are drawn there.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from pipeline.models.curved.options import CurvedOptions
from pipeline.truth.geometry.opacity import grazing_cosine, opacity
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from weaves.fabric import Fabric

_RAYS_A_COSINE = 16
_TRIED = 1024  # grazing cosines whose steepest bounds the questions about the silhouette
_BEYOND = 1.2  # how far beyond that they reach


class View(NamedTuple):
    """Where the cloth is looked at, from where, and how it is curved; n of them.

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
    """Questions about the silhouette and their answers, computed once; no part of a trained model.

    Parameters
    ----------
    view : View
        What is asked.
    target : Tensor (n, 2)
        Opacity and 0; or mean and variance of the grazing cosine, in units of sqrt(kappa) and kappa.
    """

    def __init__(self, view: View, target: Tensor) -> None:
        super().__init__()
        for name, column in zip(View._fields, view, strict=True):
            self.register_buffer(name, column, persistent=False)
        self.register_buffer("target", target, persistent=False)

    def draw(self, count: int, random: np.random.Generator) -> tuple[View, Tensor]:
        """Return `count` random questions and their answers."""
        rows = torch.from_numpy(random.integers(0, len(self.get_buffer("u")), count)).to(self.get_buffer("u").device)
        return View(*(self.get_buffer(name)[rows] for name in View._fields)), self.get_buffer("target")[rows]


def draw_silhouettes(options: CurvedOptions, fabric: Fabric) -> Silhouettes:
    """Ask the truth about a fabric's silhouettes: a pure function of options and fabric.

    Centres are uniform in the repeat, footprints log-uniform, curvatures uniform in their root up to the largest, and
    so are tangents, up to a little beyond the steepest that was found to touch. `silhouette_anywhere` of the cosines
    are uniform in [0, 1]. A grazing cosine takes some fifty rays to find, so that of these there are a sixteenth of the
    points.
    """
    rows, points = options.silhouette_rows, options.silhouette_points
    random = np.random.Generator(np.random.Philox(key=options.silhouette_seed))
    draws = random.random((rows, 7))
    ends, picks = fabric.weave.repeat
    low, high = (math.log(bound) for bound in options.silhouette_sigma)
    sigma = np.exp(low + (high - low) * draws[:, 2])
    azimuth = 2.0 * np.pi * draws[:, 5]
    # 1 - a draw is never 0.
    curvature = options.largest_curvature * np.square(1.0 - draws[:, 3])
    few = slice(_TRIED)
    tried = grazing_cosine(fabric, draws[few, 0] * ends, draws[few, 1] * picks, azimuth[few], curvature[few])
    steepest = np.sqrt(np.square(tried) / (1.0 - np.square(tried)) / curvature[few]).max()
    tangent = _BEYOND * steepest * np.sqrt(curvature) * (1.0 - draws[:, 4])
    cosine = np.where(
        draws[:, 6] < options.silhouette_anywhere, 1.0 - draws[:, 4], tangent / np.sqrt(1.0 + np.square(tangent))
    )
    sine = np.sqrt((1.0 - cosine) * (1.0 + cosine))
    wo = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), cosine], axis=-1).astype(np.float32)
    u, v = draws[:, 0] * ends, draws[:, 1] * picks
    target = np.zeros((rows, 2))
    if options.silhouette == "opacity":
        counts = TruthOptions(footprint=options.footprint, min_count=points, max_count=points)
        x, y, s = (column.astype(np.float32) for column in (u, v, sigma))
        asked = Queries.round(x, y, s, wo, wo)
        asked = asked._replace(curvature=curvature.astype(np.float32))
        target[:, 0], _ = opacity(fabric, asked, counts, options.silhouette_seed)
    else:
        shape = (2, rows, max(points // _RAYS_A_COSINE, 2))
        if options.footprint == "box":
            spread = math.sqrt(12.0) * (random.random(shape) - 0.5)
        else:
            spread = random.standard_normal(shape)
        x, y = (centre[:, None] + sigma[:, None] * s for centre, s in zip((u, v), spread, strict=True))
        touch = grazing_cosine(fabric, x, y, azimuth[:, None], curvature[:, None]) / np.sqrt(curvature)[:, None]
        target = np.stack([touch.mean(axis=1), touch.var(axis=1)], axis=-1)
    columns = (u / ends, v / picks, sigma, wo, curvature)
    view = View(*(torch.from_numpy(column.astype(np.float32)) for column in columns))
    return Silhouettes(view, torch.from_numpy(target.astype(np.float32)))
