"""Two analytic views of cloth: which patch every pixel shows, from where, and under which light.

`sphere`: the fabric's plane wrapped around a ball by the inverse stereographic projection from the far pole. It is
conformal, so yarns cross at right angles everywhere and a patch is a scaled copy of the flat fabric: the patch BSDF
holds without shear. `plane`: a plane running to the horizon, from resolved yarns in front to many repeats a pixel. The
camera is a pinhole, the light directional.

A pixel is a Gaussian of standard deviation `pixel_sigma` pixels. Its image on the tangent plane is the ellipse of the
matrix J = d(u, v)/d(pixel), found by intersecting neighbouring rays with the tangent plane [Igehy1999RayDifferentials].
Networks know round footprints, so sigma = pixel_sigma sqrt|det J| (`geometric_mean`), or pixel_sigma times the larger
singular value (`major`). Local frame of the directions: x along the weft (dp/du), y along the warp (dp/dv), z = normal.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float64, Mask
from pipeline.scenes.gbuffer import GBuffer
from pipeline.scenes.options import View, ViewOptions
from pipeline.scenes.places import unit

HEADING: Final = 37.0  # direction in which the cloth slides from frame to frame, as an angle from the weft, in degrees
_SPHERE_PIXELS = 6.0  # that a yarn spacing takes at the centre of the sphere
_FIELD_OF_VIEW = 50.0  # angle that the plane's picture spans from left to right, in degrees
_PLANE_LIGHT = (48.0, 62.0)  # degrees: angle to the normal, azimuth from the right towards the horizon
_SPHERE_DISTANCE = 4.0  # of the camera from the centre, in radii
_SPHERE_FILL = 0.94  # share of the picture's shorter side that the sphere takes


class _Surface(NamedTuple):
    """Where the rays of a view meet its surface; M rays."""

    hit: Mask  # rays that do, (H, W); M of them
    distance: Float64  # ray parameter of the hits, in lengths of the unnormalised ray, (M,)
    uv: Float64  # coordinates in yarn spacings, (M, 2)
    frame: Float64  # rows: unit vectors along the weft, along the warp, and the normal, (M, 3, 3)
    spacing: Float64  # length of a yarn spacing in the world, (M,)


def view(scene: View, width: int, height: int, frame: float = 0.0, options: ViewOptions | None = None) -> GBuffer:
    """Return what every pixel of a view shows; the cloth slides over the surface by ``frame * options.step`` pixels."""
    options = options or ViewOptions()
    render = _sphere if scene == "sphere" else _plane
    return render(width, height, frame * options.step, options)


def _sphere(width: int, height: int, shift: float, options: ViewOptions) -> GBuffer:
    # Camera on +z looking at the unit sphere around the origin; rays (x, y, -1).
    outline = math.tan(math.asin(1.0 / _SPHERE_DISTANCE))
    focal = 0.5 * _SPHERE_FILL * min(width, height) / outline
    rays = _rays(width, height, focal)
    rays[..., 2] = -1.0
    b = -_SPHERE_DISTANCE * rays[..., 2]
    a = np.einsum("hwi,hwi->hw", rays, rays)
    discriminant = b * b - a * (_SPHERE_DISTANCE**2 - 1.0)
    hit = discriminant > 0.0
    distance = (b[hit] - np.sqrt(discriminant[hit])) / a[hit]
    normal = distance[:, None] * rays[hit] + (0.0, 0.0, _SPHERE_DISTANCE)

    # Stereographic coordinates X, Y from the far pole (0, 0, -1): dp/dX, dp/dY are orthogonal, of length `scale`.
    x, y = (2.0 * normal[:, i] / (1.0 + normal[:, 2]) for i in (0, 1))
    scale = 0.5 * (1.0 + normal[:, 2])
    one = np.ones_like(x)
    along_x = np.stack([one, np.zeros_like(x), -0.5 * x], -1) - (0.5 * x)[:, None] * normal
    along_y = np.stack([np.zeros_like(x), one, -0.5 * y], -1) - (0.5 * y)[:, None] * normal
    spacing = _SPHERE_PIXELS * (_SPHERE_DISTANCE - 1.0) / focal
    uv, weft, warp = _turned(np.stack([x, y], -1) / spacing, along_x, along_y, options.turn)
    surface = _Surface(hit, distance, uv, np.stack([unit(weft), unit(warp), normal], axis=1), spacing * scale)
    light = _direction(options.sphere_light)
    return _gbuffer(surface, rays, light, shift / _SPHERE_PIXELS, options)


def _plane(width: int, height: int, shift: float, options: ViewOptions) -> GBuffer:
    # Camera above the plane z = 0 looking towards +y, pitched so that the horizon lies at `horizon` from the top.
    focal = 0.5 * width / math.tan(math.radians(0.5 * _FIELD_OF_VIEW))
    pitch = math.atan((0.5 - options.horizon) * height / focal)
    screen = _rays(width, height, focal)
    x, y, sine, cosine = screen[..., 0], screen[..., 1], math.sin(pitch), math.cos(pitch)
    rays = np.stack([x, cosine + y * sine, -sine + y * cosine], axis=-1)
    # The height of the camera, in yarn spacings, gives a spacing the requested width in the bottom row.
    bottom = -rays[-1, 0, 2]
    camera = bottom * focal / options.plane_pixels_per_yarn
    # It ends with the last row that is nowhere seen at a larger angle than requested.
    steepness = -rays[..., 2] / np.linalg.norm(rays, axis=-1)
    in_sight = (steepness >= math.cos(math.radians(options.largest_angle))).all(axis=1)
    hit = np.broadcast_to(in_sight[:, None], steepness.shape)
    distance = camera / -rays[hit][:, 2]
    position = distance[:, None] * rays[hit]
    ones = np.ones(len(distance))
    east, north, up = (np.outer(ones, axis) for axis in np.eye(3))
    uv, weft, warp = _turned(position[:, :2], east, north, options.turn)
    surface = _Surface(hit, distance, uv, np.stack([weft, warp, up], axis=1), ones)
    light = _direction(_PLANE_LIGHT)
    return _gbuffer(surface, rays, light, shift / options.plane_pixels_per_yarn, options)


def _gbuffer(surface: _Surface, rays: Float64, light: Float64, slide: float, options: ViewOptions) -> GBuffer:
    """Bring directions and footprints into the local frames; `slide` in yarn spacings."""
    wo = -unit(np.einsum("mij,mj->mi", surface.frame, rays[surface.hit]))
    wi = surface.frame @ light
    seen = wo[:, 2] >= math.cos(math.radians(options.largest_angle))
    above = seen & (wi[:, 2] > 0.0)
    mask, lit = np.zeros_like(surface.hit), np.zeros_like(surface.hit)
    mask[surface.hit], lit[surface.hit] = seen, above

    # The cloth slides along `HEADING`: the same pixel then shows a patch further back.
    heading = math.radians(HEADING)
    uv = surface.uv - slide * np.array([math.cos(heading), math.sin(heading)])
    sigma = _footprint(surface, rays, options)[above]
    flat, (u, v) = np.zeros_like(sigma), uv[above].T
    queries = np.arange(len(sigma)), wi[above], np.full((len(sigma), 3), options.irradiance)
    return GBuffer(mask, np.flatnonzero(lit), u, v, sigma, sigma, flat, flat, wo[above], *queries)


def _footprint(surface: _Surface, rays: Float64, options: ViewOptions) -> Float64:
    """Return the round footprint of every hit pixel, in yarn spacings.

    With the hit p = o + t d, moving the ray by e keeps p on the tangent plane when dp = t (e - d (n.e)/(n.d)).
    """
    ray, normal, columns = rays[surface.hit], surface.frame[:, 2], []
    for step in (rays[0, 1] - rays[0, 0], rays[0, 0] - rays[1, 0]):  # to the right, and up
        slope = (normal @ step) / np.einsum("mi,mi->m", normal, ray)
        moved = surface.distance[:, None] * (step - ray * slope[:, None])
        columns.append(np.einsum("mij,mj->mi", surface.frame[:, :2], moved) / surface.spacing[:, None])
    jacobian = np.stack(columns, axis=-1)
    determinant = np.abs(np.linalg.det(jacobian))
    if options.footprint == "geometric_mean":
        axis = np.sqrt(determinant)
    else:
        # Larger singular value of a 2 x 2 matrix: s1^2 + s2^2 = |J|^2, s1 s2 = |det J|.
        square = np.einsum("mij,mij->m", jacobian, jacobian)
        axis = 0.5 * (np.sqrt(square + 2.0 * determinant) + np.sqrt(np.maximum(square - 2.0 * determinant, 0.0)))
    return np.asarray(np.minimum(options.pixel_sigma * axis, options.largest_sigma))


def _rays(width: int, height: int, focal: float) -> Float64:
    """Return screen coordinates of the pixel centres over the focal length, x right and y up, (H, W, 3); z is 0."""
    x = (np.arange(width) + 0.5 - 0.5 * width) / focal
    y = (0.5 * height - np.arange(height) - 0.5) / focal
    return np.stack(np.broadcast_arrays(x[None, :], y[:, None], 0.0), axis=-1)


def _turned(position: Float64, along_x: Float64, along_y: Float64, turn: float) -> tuple[Float64, Float64, Float64]:
    """Turn coordinates and axes counter-clockwise by `turn` degrees."""
    cosine, sine = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    uv = position @ np.array([[cosine, -sine], [sine, cosine]])
    return uv, cosine * along_x + sine * along_y, cosine * along_y - sine * along_x


def _direction(angles: tuple[float, float]) -> Float64:
    """Return the unit vector at (angle from z, azimuth from x) in degrees."""
    polar, azimuth = (math.radians(angle) for angle in angles)
    return np.array([math.sin(polar) * math.cos(azimuth), math.sin(polar) * math.sin(azimuth), math.cos(polar)])
