"""One point's share of a patch BSDF [Zhu2023Cloth], [Chen2024Woven].

f_P(wi, wo) = sum k F V(wi) A(wo) / sum k A(wo), with A(wo) = <wo.n_p> / (n_s.n_p) V(wo) and F the point model times
<wi.n_p>. The four components keep unit colour: specular F by family, and diffuse
(w_d <wi.n_p> + (1 - w_d) <wi.n_s>) / pi by family. Light from behind is transmitted: shadowed by the back of the
cloth, with -wi in the diffuse cosines. A gap has A = <wo.n_s> V(wo), returns nothing, and lets through what neither
side hides.
"""

import math
from typing import NamedTuple

from pipeline.compiled.decorators import inlined_kernel, kernel
from pipeline.truth.geometry.first_hit import MISSED, ON_WALL, first_hit, sinking
from pipeline.truth.geometry.heightfield import ALPHA, BLEND, GAP, UNDER, HeightField, surface_at
from pipeline.truth.geometry.march import Ray, ray, wrap
from pipeline.truth.geometry.visibility import gap_clear, visible
from pipeline.truth.scattering.slab import density, reflection, sigma, transmission, unscattered

Surface = tuple[int, int, float, float, float, float, float, float, float]
"""Surface at a point, as `surface_at` returns it."""


class Choices(NamedTuple):
    """The options of the model as kernels read them."""

    macro: bool  # cosines in the slab and in A are taken to n_s instead of n_p
    shadows: bool  # true if points can hide one another
    rims: bool = False  # true if view rays that meet a wall see the yarn's rim above it


class Directions(NamedTuple):
    """One query's light and viewer, both in front as the viewer sees it."""

    light: Ray
    viewer: Ray
    """wi and wo."""
    light_behind: Ray
    viewer_behind: Ray
    """wi and -wo as the back of the cloth sees them, reflected in its plane."""


@kernel
def directions_of(ix: float, iy: float, iz: float, ox: float, oy: float, oz: float, curvature: float) -> Directions:
    """Prepare unit wi and wo, wo with z > 0, over a cylinder curved by `curvature` in the viewer's plane.

    Towards the light the cylinder is curved by Euler's curvature * cos^2 of the angle between the two planes.
    """
    across = ix * ox + iy * oy
    squares = (ix * ix + iy * iy) * (ox * ox + oy * oy)
    # A viewer on the normal looks along x.
    turn = across * across / squares if squares > 1e-18 else ix * ix / max(ix * ix + iy * iy, 1e-300)
    return Directions(
        ray(ix, iy, iz, curvature * min(turn, 1.0)),
        ray(ox, oy, oz, curvature),
        ray(ix, iy, -iz, 0.0),
        ray(-ox, -oy, oz, 0.0),
    )


@inlined_kernel
def point_share(
    front: HeightField, back: HeightField, x: float, y: float, directions: Directions, choices: Choices
) -> tuple[int, float, float, float, float]:
    """Return the shares of a point, 0 <= x < ends, 0 <= y < picks, in the numerators and the denominator.

    First the family: WARP, WEFT or GAP; then A(wo); F_specular V(wi) A(wo); F_diffuse V(wi) A(wo); and the unscattered
    share, times A(wo).
    """
    viewer = directions.viewer
    surface = surface_at(front, x, y, int(x), int(y))
    family, side, z, nx, ny, nz, _, _, _ = surface
    if family == GAP:
        # A ray that enters a gap and ends on a yarn further down counts there, not here.
        if choices.shadows and not gap_clear(front, back, x, y, viewer, directions.viewer_behind):
            return family, 0.0, 0.0, 0.0, 0.0
        return family, viewer.z, 0.0, 0.0, viewer.z

    # Visibility of the point to the viewer.
    cos_o = viewer.x * nx + viewer.y * ny + viewer.z * nz
    if cos_o <= 0.0 or nz <= 0.0 or (choices.shadows and not visible(front, x, y, z, side, viewer)):
        return family, 0.0, 0.0, 0.0, 0.0
    if choices.macro:
        cos_o, area = viewer.z, viewer.z
    else:
        area = cos_o / nz
    return _yarn_share(front, back, x, y, surface, cos_o, area, directions, choices)


@inlined_kernel
def ray_share(
    front: HeightField, back: HeightField, plane: float, x: float, y: float, directions: Directions, choices: Choices
) -> tuple[int, float, float, float, float, float, float]:
    """Return the same for the view ray that crosses the reference plane at (x, y), and how far from there it ends.

    With dq the area in which the rays of a patch cross the plane, A(wo) dp = (n_s.wo) dq: every ray that meets a yarn
    has the area n_s.wo. One that meets a wall has none, or sees the rim above if that faces the viewer. One that meets
    nothing on either side of a gap of the fabric plane is light that goes straight through. On curved cloth wo has the
    same angle to the tangent plane everywhere, as in `pipeline.truth.geometry.opacity`.
    """
    viewer = directions.viewer
    towards, along, down = sinking(viewer, front.highest, plane)
    hit = first_hit(front, x + along * viewer.dx, y + along * viewer.dy, front.highest, towards)
    moved_x, moved_y = (along - hit.distance) * viewer.dx, (along - hit.distance) * viewer.dy
    if (hit.what == MISSED or hit.distance > down) and down < math.inf:
        picks, ends = front.top.shape
        at_x = wrap(x + (along - down) * viewer.dx, float(ends))
        at_y = wrap(y + (along - down) * viewer.dy, float(picks))
        family, _, _, _, _, _, _, _, _ = surface_at(front, at_x, at_y, int(at_x), int(at_y))
        # Below the fabric plane a yarn is solid down to its back: a ray that clears the back meets none of its walls.
        if family == GAP and visible(back, at_x, at_y, 0.0, UNDER, directions.viewer_behind):
            return GAP, viewer.z, 0.0, 0.0, viewer.z, moved_x, moved_y
    if hit.what == MISSED:
        return GAP, 0.0, 0.0, 0.0, 0.0, moved_x, moved_y
    surface = surface_at(front, hit.x, hit.y, hit.end, hit.pick)
    family, _, _, nx, ny, nz, _, _, _ = surface
    cos_o = viewer.x * nx + viewer.y * ny + viewer.z * nz
    if (hit.what == ON_WALL and not choices.rims) or cos_o <= 0.0:
        return family, 0.0, 0.0, 0.0, 0.0, moved_x, moved_y
    _, area, specular, diffuse, through = _yarn_share(
        front, back, hit.x, hit.y, surface, cos_o, viewer.z, directions, choices
    )
    return family, area, specular, diffuse, through, moved_x, moved_y


@inlined_kernel
def _yarn_share(
    front: HeightField, back: HeightField, x: float, y: float, surface: Surface, cos_o: float, area: float,
    directions: Directions, choices: Choices,
) -> tuple[int, float, float, float, float]:  # fmt: skip
    """Return the shares of a point of a yarn that the viewer sees; `area` is its A(wo)."""
    light, viewer = directions.light, directions.viewer
    family, side, z, nx, ny, nz, tx, ty, tz = surface
    alpha, blend = front.yarn[family, ALPHA], front.yarn[family, BLEND]
    sigma_o = sigma(viewer.x, viewer.y, viewer.z, tx, ty, tz, alpha)
    through = area * unscattered(sigma_o, cos_o, front.thickness)

    # Light that reaches it, from the front or through the cloth.
    cos_i = light.x * nx + light.y * ny + light.z * nz
    # Over a curved cloth the front may see a light below its tangent plane; one that it does not see is behind.
    lit, transmitted = False, False
    if light.z > 0.0 or light.bend > 0.0:
        lit = cos_i > 0.0 and (not choices.shadows or visible(front, x, y, z, side, light))
    if not lit and light.z < 0.0:
        lit = transmitted = cos_i < 0.0 and lit_from_behind(back, x, y, directions.light_behind, choices)
    if not lit:
        return family, area, 0.0, 0.0, through
    facing = abs(cos_i)
    slab_i = abs(light.z) if choices.macro else facing
    flakes = density(light.x + viewer.x, light.y + viewer.y, light.z + viewer.z, tx, ty, tz, alpha)
    sigma_i = sigma(light.x, light.y, light.z, tx, ty, tz, alpha)
    if transmitted:
        specular = slab_i * transmission(flakes, sigma_i, sigma_o, slab_i, cos_o, front.thickness)
    else:
        specular = slab_i * reflection(flakes, sigma_i, sigma_o, slab_i, cos_o, front.thickness)
    diffuse = (blend * facing + (1.0 - blend) * (abs(light.z) if transmitted else max(light.z, 0.0))) / math.pi
    return family, area, specular * area, diffuse * area, through


@inlined_kernel
def lit_from_behind(back: HeightField, x: float, y: float, light: Ray, choices: Choices) -> bool:
    """Return whether the back of the cloth sees the light at (x, y), everything reflected in the fabric plane."""
    if not choices.shadows:
        return True
    _, side, z, nx, ny, nz, _, _, _ = surface_at(back, x, y, int(x), int(y))
    return light.x * nx + light.y * ny + light.z * nz > 0.0 and visible(back, x, y, z, side, light)
