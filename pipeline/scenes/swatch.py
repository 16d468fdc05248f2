"""The scene `swatch` in closed form: the pixels of a large picture as queries in a second, without Mitsuba.

The cloth is a square with one soft fold, z(y) = .01 + .05 (1 + cos 2 pi y) for |x|, |y| <= 1/2, on a board z = 0 under
two distant lights. A ray meets both by Newton's method. The camera is steep enough that no view ray leaves the cloth
again (a slope of .57 of the ray to the cloth would be needed), and the lights that the cloth has no shadow on itself.
Footprints and curvature are those of `pipeline.scenes.frame`.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float64, Index, Mask
from pipeline.scenes.frame import SceneFrame
from pipeline.scenes.gbuffer import LEAST_SIGMA, GBuffer
from pipeline.scenes.loading import FilmWindow
from pipeline.scenes.options import PixelOptions
from pipeline.scenes.places import LEAST_CURVATURE, dot, tilted, unit

EYE: Final = (0.0, -1.5, 1.6)  # place of the camera
LOOKED_AT: Final = (0.0, -0.02, 0.03)  # place in the middle of the picture
FIELD_OF_VIEW: Final = 34.0  # angle of the picture's width, in degrees
LIGHTS: Final = (((-0.55, 0.75, 0.75), 2.4), ((0.6, -0.5, 1.0), 0.5))
"""Direction to each light, of any length, and its irradiance on a surface that faces it."""
BOARD: Final = 0.25  # albedo of the board
HALF_BOARD: Final = 20.0  # half its side; that of the cloth is 1/2
_PIXELS = PixelOptions()
_STEPS = 8  # of Newton's method: the slope is at most .32


def height(y: Float64) -> Float64:
    """Return the height of the cloth above the board."""
    return np.asarray(0.01 + 0.05 * (1.0 + np.cos(2.0 * np.pi * y)))


def _slope(y: Float64) -> Float64:
    return np.asarray(-0.1 * np.pi * np.sin(2.0 * np.pi * y))


class Swatch(NamedTuple):
    """A square of cloth and its picture."""

    yarns: float  # yarn spacings along each side
    size: tuple[int, int]  # width and height in pixels

    def frame(self, window: FilmWindow) -> SceneFrame:
        """Return what every pixel of a window shows."""
        eye, forward = np.array(EYE), unit(np.array(LOOKED_AT) - EYE)
        pixel = 2.0 * math.tan(math.radians(0.5 * FIELD_OF_VIEW)) / self.size[0]
        right = pixel * unit(np.cross(forward, [0.0, 0.0, 1.0]))
        down = pixel * unit(np.cross(forward, right))
        columns, rows = (
            first + np.arange(count) + 0.5 - 0.5 * whole
            for first, count, whole in zip(window[:2], window[2:], self.size, strict=True)
        )
        ray = (forward + columns[:, None] * right + rows[:, None, None] * down).reshape(-1, 3)
        distance, shown = _met(np.broadcast_to(eye, ray.shape), ray)
        behind = np.where(ray[:, 2] < 0.0, -eye[2] / np.minimum(ray[:, 2], -1e-9), np.inf)
        ground = eye + np.where(np.isfinite(behind), behind, 0.0)[:, None] * ray
        board = np.isfinite(behind) & (np.abs(ground[:, :2]) <= HALF_BOARD).all(axis=1)
        light, backdrop = np.zeros(len(ray)), np.zeros((len(ray), 3))
        for towards, power in LIGHTS:
            way = unit(np.array(towards))
            # Behind the cloth the board is seen without the cloth's shadow.
            light += (shown | ~_met(ground, np.broadcast_to(way, ground.shape))[1]) * power * way[2]
        backdrop[board] = (BOARD / math.pi * light[board])[:, None]
        pixels = np.flatnonzero(shown)
        position = eye + distance[pixels, None] * ray[pixels]
        gbuffer, normal = self._gbuffer(shown.reshape(len(rows), -1), pixels, position, ray[pixels], right, down)
        depth, normals = np.where(board, behind, 0.0), np.where(board[:, None], [0.0, 0.0, 1.0], 0.0)
        depth[pixels], normals[pixels] = distance[pixels], normal
        shape = len(rows), len(columns)
        planes = backdrop.reshape(*shape, 3), depth.reshape(shape), normals.reshape(*shape, 3)
        return SceneFrame({"swatch": gbuffer}, *planes)

    def _gbuffer(
        self, mask: Mask, pixels: Index, position: Float64, ray: Float64, right: Float64, down: Float64
    ) -> tuple[GBuffer, Float64]:
        """Return the G-buffer and the normals of the places of the cloth."""
        y = position[:, 1]
        slope, bend = _slope(y), -0.2 * np.pi**2 * np.cos(2.0 * np.pi * y)
        level = 1.0 / np.sqrt(1.0 + np.square(slope))
        along = np.stack([np.zeros_like(y), level, level * slope], axis=-1)
        normal = np.stack([np.zeros_like(y), -level * slope, level], axis=-1)
        frame = np.stack([np.broadcast_to([1.0, 0.0, 0.0], along.shape), along, normal], axis=1)

        # The ways of the ray's place in the tangent plane for one pixel to the right and one downwards.
        facing, away = dot(normal, ray), dot(normal, position - EYE)
        moves = [(away / (facing + normal @ step))[:, None] * (ray + step) - (position - EYE) for step in (right, down)]
        jacobian = self.yarns * np.stack([np.einsum("nij,nj->ni", frame[:, :2], move) for move in moves], axis=-1)
        a, b, c = (dot(jacobian[:, i], jacobian[:, j]) for i, j in ((0, 0), (0, 1), (1, 1)))
        middle, radius = 0.5 * (a + c), np.hypot(0.5 * (a - c), b)
        sizes = np.sqrt(np.maximum([middle + radius, middle - radius], 0.0))
        sigma, sigma_minor = np.clip(_PIXELS.pixel_sigma * sizes, LEAST_SIGMA, _PIXELS.largest_sigma)

        straight = np.einsum("nij,nj->ni", frame, unit(EYE - position))
        wo = tilted(straight, np.ones(len(y)), _PIXELS.largest_angle)
        share = np.square(wo[:, 1]) / np.maximum(np.square(wo[:, :2]).sum(axis=1), 1e-300)
        curvature = -bend * level**3 * share / self.yarns
        curvature = np.where(curvature > LEAST_CURVATURE, curvature, 0.0)
        fine = np.linspace(-0.5, 0.5, 4097)
        length = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(fine), np.diff(height(fine))))])
        wi = np.stack([frame @ unit(np.array(towards)) for towards, _ in LIGHTS], axis=1).reshape(-1, 3)
        place = np.repeat(np.arange(len(y)), len(LIGHTS))
        power = np.tile([power for _, power in LIGHTS], len(y))
        u, v = self.yarns * position[:, 0], self.yarns * np.interp(y, fine, length)
        angle = 0.5 * np.arctan2(2.0 * b, a - c)
        irradiance = np.repeat(power[:, None], 3, axis=1)
        footprint = (u, v, sigma, sigma_minor, angle, curvature)
        return GBuffer(mask, pixels, *footprint, wo, place, wi, irradiance), normal


def _met(start: Float64, ray: Float64) -> tuple[Float64, Mask]:
    """Return how far along each of N rays the fold is, in their lengths, and whether the cloth is there."""
    with np.errstate(all="ignore"):
        distance = (0.06 - start[:, 2]) / ray[:, 2]
        for _ in range(_STEPS):
            y = start[:, 1] + distance * ray[:, 1]
            above = start[:, 2] + distance * ray[:, 2] - height(y)
            distance = distance - above / (ray[:, 2] - _slope(y) * ray[:, 1])
        x, y = (start[:, axis] + distance * ray[:, axis] for axis in (0, 1))
        return distance, (np.abs(x) <= 0.5) & (np.abs(y) <= 0.5) & (distance > 0.0)
