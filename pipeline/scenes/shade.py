"""From components to pictures: colour is applied last, so editing it costs nothing.

f_P = k_s,warp S_warp + k_s,weft S_weft + k_d,warp C_warp + k_d,weft C_weft already contains the incident cosine
(pipeline.truth.conventions): under a light of irradiance E a pixel's radiance is E f_P.
"""

import numpy as np
import numpy.typing as npt

from pipeline.analytic.footprint_colours import footprint_colours
from pipeline.compiled.arrays import Float32, Float64
from pipeline.scenes.bounces import check_bounces, later_bounces
from pipeline.scenes.gbuffer import GBuffer
from pipeline.scenes.options import BOUNCES, Bounces
from pipeline.truth.query import Queries
from weaves.fabric import Fabric


def colours(fabric: Fabric, transmitted: bool = False) -> Float64:
    """Return the linear RGB colours of the components in the order of `pipeline.truth.conventions.COMPONENTS`, (4, 3).

    Where ends or picks differ in colour, these are the means of their repeats. Light that is `transmitted`, from the
    other side of the cloth, takes the diffuse colours k_dt.
    """
    yarns = (fabric.average().warp, fabric.average().weft)
    diffuse = [yarn.diffuse_transmission_rgb if transmitted else yarn.diffuse_rgb for yarn in yarns]
    return np.array([*(yarn.specular_rgb for yarn in yarns), *diffuse], dtype=np.float64)


def colours_of(fabric: Fabric, queries: Queries) -> Float64:
    """Return the colours of the components of each query, (N, 4, 3): transmitted light has its own.

    Where ends or picks differ in colour, these are mean colours of the footprint's threads
    (`pipeline.analytic.footprint_colours`).
    """
    if fabric.colours is not None:
        return footprint_colours(fabric, queries)
    through = queries.wi[:, 2] * queries.wo[:, 2] < 0.0
    return np.where(through[:, None, None], colours(fabric, transmitted=True), colours(fabric))


def shade(
    fabric: Fabric,
    components: npt.ArrayLike,
    queries: Queries,
    bounces: Bounces = BOUNCES,
    colours: npt.NDArray[np.floating] | None = None,
) -> Float64:
    """Return the patch BSDF in linear RGB, (N, 3), from components with unit colour, (N, 4), and their queries.

    With all bounces, light that yarns give to each other is added. Colours, (N, 4, 3), are those of `colours_of` unless
    given. BadInput for another number of bounces.
    """
    check_bounces(bounces, "shade")
    colours = colours_of(fabric, queries) if colours is None else colours
    rgb = coloured(components, colours)
    return rgb if bounces == 1 else rgb + later_bounces(fabric, queries, colours).sum(axis=1)


def coloured(components: npt.ArrayLike, colours: npt.NDArray[np.floating]) -> Float64:
    """Return the patch BSDF in linear RGB, (N, 3), from components (N, 4) and the colours of each, (N, 4, 3)."""
    return np.asarray(np.einsum("nc,ncx->nx", np.asarray(components, np.float64), colours))


def compose(
    gbuffer: GBuffer,
    rgb: npt.ArrayLike,
    background: npt.ArrayLike = 0.0,
    transparency: npt.ArrayLike = 0.0,
    coverage: npt.ArrayLike = 1.0,
) -> Float32:
    """Lay a fabric over a background, in linear RGB (H, W, 3); several fabrics one after the other.

    A place shows C (L + T background) + (1 - C) background: C the coverage, T the transparency, L the sum of
    irradiance times f_P over its lights. The share 1 - C of the view rays leaves curved cloth again; the others meet a
    yarn or run into a gap. f_P and T are means over just these: gaps are dark in f_P and clear in T. So gaps count
    once, opacity is C (1 - gaps), and flat cloth has C = 1. The background is `SceneFrame.backdrop`: cloth behind
    cloth is not seen through gaps, nor past a silhouette.

    `rgb` (M, 3) is the patch BSDF of the M queries; the background a number or a picture (H, W, 3); transparency and
    coverage of the N places are numbers or (N,).
    """
    light = np.zeros((len(gbuffer.pixel), 3))
    np.add.at(light, gbuffer.place, gbuffer.irradiance * np.asarray(rgb))
    picture = np.empty((*gbuffer.mask.shape, 3))
    picture[:] = background
    flat = picture.reshape(-1, 3)
    covered = np.broadcast_to(coverage, len(light))[:, None]
    through = 1.0 - covered + covered * np.broadcast_to(transparency, len(light))[:, None]
    behind = flat[gbuffer.pixel] * through
    # Pixels of the fabric that no place speaks for are black.
    picture[gbuffer.mask] = 0.0
    flat[gbuffer.pixel] = covered * light + behind
    return picture.astype(np.float32)
