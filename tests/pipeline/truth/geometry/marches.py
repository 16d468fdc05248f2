"""Rays followed in small steps through the heights of `weaves.surface`, which share no code with the kernels."""

import math

import numpy as np

from pipeline.truth.geometry.heightfield import height_field
from weaves.surface import GAP, surface_at


def leaves(fabric, x, y, z, w, curvature=0.0, step=0.0025):
    """Say for each point (x, y, z) whether a march towards w leaves the cloth."""
    flat, highest = math.hypot(w[0], w[1]), height_field(fabric).highest
    free, left, s = np.ones(len(x), bool), np.arange(len(x)), 0.0
    while left.size:
        s += step
        rise = w[2] / flat + curvature * s
        altitude = z[left] + s * (w[2] / flat + 0.5 * curvature * s)
        point = surface_at(fabric, x[left] + s * w[0] / flat, y[left] + s * w[1] / flat)
        hidden = (point.yarn != GAP) & (point.height > altitude + 1e-9)
        free[left[hidden]] = False
        left = left[~hidden & ((altitude < highest) | (rise <= 0.0))]
    return free
