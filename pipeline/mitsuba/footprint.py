"""Footprints of rays: standard deviations on the cloth, from derivatives of its place or from a pixel's angle.

A footprint is the Gaussian of `PIXEL` pixels under J = d(u, v in yarns)/d(pixel): its axes are J's left singular
vectors, its deviations `PIXEL` times the singular values [Igehy1999RayDifferentials].
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float32, Float64, Mask
from pipeline.scenes.options import SceneOptions

PIXEL: Final = SceneOptions().pixel_sigma
"""Standard deviation of a pixel's Gaussian, in pixels."""

LARGEST: Final = SceneOptions().largest_sigma
"""Both axes of a footprint are cut here, in yarn spacings; where derivatives are not finite, they are this long."""

_LEAST = 1e-6


class Footprints(NamedTuple):
    """N footprints; columns as in `pipeline.truth.query.Queries`."""

    sigma: Float32
    sigma_minor: Float32
    angle: Float32

    @classmethod
    def of(cls, jacobian: Float64) -> Footprints:
        """Return the footprints of N pixels, from d(uv in yarns)/d(pixel), (N, 2, 2)."""
        lost = np.asarray(~np.isfinite(jacobian).all(axis=(1, 2)))
        j = np.where(lost[:, None, None], np.eye(2) * (LARGEST / PIXEL), jacobian)
        j = np.clip(j, -1e12, 1e12)
        # Eigenvalues of J J^T in closed form; the smaller one from the determinant, free of cancellation.
        xx, yy, xy = (np.einsum("ni,ni->n", j[:, a], j[:, b]) for a, b in ((0, 0), (1, 1), (0, 1)))
        apart = np.hypot(0.5 * (xx - yy), xy)
        major = np.sqrt(0.5 * (xx + yy) + apart)
        area = np.abs(j[:, 0, 0] * j[:, 1, 1] - j[:, 0, 1] * j[:, 1, 0])
        minor = area / np.maximum(major, 1e-150)
        angle = 0.5 * np.arctan2(xy, 0.5 * (xx - yy))
        return cls(_cut(PIXEL * major), _cut(PIXEL * minor), angle.astype(np.float32))

    @classmethod
    def round(cls, sigma: Float64) -> Footprints:
        """Return N round footprints."""
        size = _cut(sigma)
        return cls(size, size, np.zeros_like(size))

    @classmethod
    def joined(cls, chosen: Mask, one: Footprints, other: Footprints) -> Footprints:
        """Return `one` where chosen, (N,), and `other` elsewhere."""
        return cls(*(np.where(chosen, a, b) for a, b in zip(one, other, strict=True)))


def _cut(deviation: Float64) -> Float32:
    """Return deviations cut to the sizes that queries may have."""
    return np.clip(deviation, _LEAST, LARGEST).astype(np.float32)
