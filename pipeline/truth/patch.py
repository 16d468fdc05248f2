"""One point's share of a patch BSDF [Zhu2023Cloth], [Chen2024Woven].

f_P(wi, wo) = sum k F V(wi) A(wo) / sum k A(wo), with A(wo) = <wo.n_p> / (n_s.n_p) V(wo) and F the point model times
<wi.n_p>. The four components keep unit colour: specular F by family, and diffuse
(w_d <wi.n_p> + (1 - w_d) <wi.n_s>) / pi by family.
"""

from __future__ import annotations

import math

from pipeline.truth.heightfield import ALPHA, BLEND, GAP, HeightField, surface_at
from pipeline.truth.kernel import kernel
from pipeline.truth.microflake import density, sigma
from pipeline.truth.slab import reflection
from pipeline.truth.visibility import Ray, visible


@kernel
def point_share(
    field: HeightField,
    x: float,
    y: float,
    ix: float,
    iy: float,
    iz: float,
    light: Ray,
    ox: float,
    oy: float,
    oz: float,
    viewer: Ray,
) -> tuple[int, float, float, float]:
    """Return what the point (x, y) of the repeat adds to numerators and denominator.

    Parameters
    ----------
    field : HeightField
        The repeat.
    x, y : float
        Position in it, 0 <= x < ends, 0 <= y < picks.
    ix, iy, iz, ox, oy, oz : float
        Unit wi and wo, both with z > 0.
    light, viewer : Ray
        The same directions, prepared for visibility.

    Returns
    -------
    family : int
        WARP, WEFT or GAP.
    area, specular, diffuse : float
        A(wo); F_specular V(wi) A(wo); F_diffuse V(wi) A(wo).
    """
    family, side, z, nx, ny, nz, tx, ty, tz = surface_at(field, x, y, int(x), int(y))
    if family == GAP:
        return family, 0.0, 0.0, 0.0
    cos_o = ox * nx + oy * ny + oz * nz
    if cos_o <= 0.0 or nz <= 0.0 or not visible(field, x, y, z, side, viewer):
        return family, 0.0, 0.0, 0.0
    area = cos_o / nz

    # A point that faces away from the light lies in its own shadow.
    cos_i = ix * nx + iy * ny + iz * nz
    if cos_i <= 0.0 or not visible(field, x, y, z, side, light):
        return family, area, 0.0, 0.0
    alpha, blend = field.yarn[family, ALPHA], field.yarn[family, BLEND]
    specular = cos_i * reflection(
        density(ix + ox, iy + oy, iz + oz, tx, ty, tz, alpha),
        sigma(ix, iy, iz, tx, ty, tz, alpha),
        sigma(ox, oy, oz, tx, ty, tz, alpha),
        cos_i,
        cos_o,
        field.thickness,
    )
    diffuse = (blend * cos_i + (1.0 - blend) * iz) / math.pi
    return family, area, specular * area, diffuse * area
