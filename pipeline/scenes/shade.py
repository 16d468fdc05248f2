"""From components to pictures: colour is applied last, so editing it costs nothing.

f_P = k_s,warp S_warp + k_s,weft S_weft + k_d,warp C_warp + k_d,weft C_weft already contains the incident cosine
(pipeline.truth.frames): under a directional light of irradiance E a pixel's radiance is E f_P.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipeline.scenes.gbuffer import GBuffer
from weaves.fabric import Fabric


def colours(fabric: Fabric, transmitted: bool = False) -> npt.NDArray[np.float64]:
    """Return the linear RGB colours of the components in the order of `frames.COMPONENTS`, (4, 3).

    Light that is `transmitted`, from the other side of the cloth, takes the diffuse colours k_dt.
    """
    yarns = (fabric.warp, fabric.weft)
    diffuse = [yarn.diffuse_transmission_rgb if transmitted else yarn.diffuse_rgb for yarn in yarns]
    return np.array([*(yarn.specular_rgb for yarn in yarns), *diffuse], dtype=np.float64)


def shade(fabric: Fabric, components: npt.ArrayLike, transmitted: bool = False) -> npt.NDArray[np.float64]:
    """Return the patch BSDF in linear RGB, (N, 3).

    Parameters
    ----------
    fabric : Fabric
        Whose colours are applied.
    components : array_like (N, 4)
        S_warp, S_weft, C_warp, C_weft with unit colour.
    transmitted : bool
        Whether light and viewer are on different sides of the cloth.
    """
    return np.asarray(np.asarray(components, dtype=np.float64) @ colours(fabric, transmitted))


def compose(gbuffer: GBuffer, rgb: npt.ArrayLike, background: float = 0.0) -> npt.NDArray[np.float32]:
    """Return the picture of a view in linear RGB, (H, W, 3).

    Parameters
    ----------
    gbuffer : GBuffer
        The view.
    rgb : array_like (N, 3)
        Patch BSDF of its N lit pixels.
    background : float
        Value of the pixels that show no cloth.
    """
    picture = np.full((*gbuffer.mask.shape, 3), background, dtype=np.float32)
    picture[gbuffer.mask] = 0.0
    picture[gbuffer.lit] = gbuffer.irradiance * np.asarray(rgb)
    return picture
