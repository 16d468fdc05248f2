"""Conventions of all modules: axes, units, directions, components. They are stated here once.

Axes
    Fabric plane z = 0, macro normal n_s = +z; warp yarns run along y, weft yarns along x. Length: one yarn spacing.
Directions
    `wi` points to the light, `wo` to the viewer: unit vectors away from the surface. z < 0 is the back side.
Cosine
    `f_P` ALREADY CONTAINS the incident cosine: outgoing radiance = integral of f_P(wi, wo) L(wi) d(wi).
Components
    `S_warp, S_weft` (specular) and `C_warp, C_weft` (diffuse), each with unit colour, all over one denominator:
    f_P = k_s,warp S_warp + k_s,weft S_weft + k_d,warp C_warp + k_d,weft C_weft.
Gaps and transmission
    Where no yarn covers the fabric plane is a gap, at z = 0; what is seen through it counts in the denominator only.
    `transparency` is the share of light from straight behind (-wo) that reaches the viewer unscattered: through gaps,
    and through yarns as exp(-T Lambda). wi and wo on different sides mean transmission: specular components then
    take k_s, diffuse ones the colour k_dt. A viewer behind the cloth sees `Fabric.back()`, reflected in the plane.
Curved cloth
    Wrapped around a cylinder, the cloth falls away from its tangent plane by kappa s^2 / 2 at distance s.
Names
    t fibre tangent, n_p ply normal, n_s macro normal, alpha roughness [Wang2022SpongeCake], [Zhu2023Cloth].
Local yarn frame
    x across the yarn, y along it, from the float's centre. Warp: the fabric's own x, y. Weft: (x, y) -> (y, -x).
"""

from typing import Final

COMPONENTS: Final = ("specular_warp", "specular_weft", "diffuse_warp", "diffuse_weft")
"""Names of the four components, in the order of every (N, 4) array and of the shard columns."""

TRANSPARENCY: Final = "transparency"
"""Name of the share that goes straight through, beside the components in answers and shards."""
