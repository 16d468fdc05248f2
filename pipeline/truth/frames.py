"""The conventions every module follows; stated here once.

Axes
    Fabric plane z = 0, macro normal n_s = +z; warp yarns run along y, weft yarns along x. Length: one yarn spacing.
Directions
    `wi` points to the light, `wo` to the viewer: unit vectors away from the surface. z < 0 is the back side.
Cosine
    `f_P` ALREADY CONTAINS the incident cosine: outgoing radiance = integral of f_P(wi, wo) L(wi) d(wi).
Components
    `S_warp, S_weft` (specular) and `C_warp, C_weft` (diffuse), each with unit colour, all over one denominator:
    f_P = k_s,warp S_warp + k_s,weft S_weft + k_d,warp C_warp + k_d,weft C_weft.
Names
    t fibre tangent, n_p ply normal, n_s macro normal, alpha roughness [Wang2022SpongeCake], [Zhu2023Cloth].
Local yarn frame
    x across the yarn, y along it, from the float's centre. Warp: the fabric's own x, y. Weft: (x, y) -> (y, -x).
"""

from __future__ import annotations

from typing import Final

COMPONENTS: Final = ("specular_warp", "specular_weft", "diffuse_warp", "diffuse_weft")
"""Names of the four components, in the order of every (N, 4) array and of the shard columns."""
