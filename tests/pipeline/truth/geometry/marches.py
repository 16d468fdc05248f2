"""Rays followed in small steps through the heights of `weaves.surface`, which share no code with the kernels."""

import math

import numpy as np

from pipeline.truth.geometry.heightfield import height_field
from weaves.surface import surface_at

NEVER = 1e9


def marched(fabric, x, y, z, towards, step, lowest=-math.inf):
    """Return for each point (x, y, z) the first distance, in steps, at which the cloth is above its ray, or NEVER.

    `towards` is (dx, dy, rise, bend). Below `lowest` a ray that sinks meets nothing."""
    met, left, s, highest = np.full(len(x), NEVER), np.arange(len(x)), 0.0, height_field(fabric).highest
    dx, dy, rise, bend = towards
    while left.size:
        s += step
        altitude, sinks = z[left] + s * (rise + 0.5 * bend * s), rise + bend * s <= 0.0
        below = surface_at(fabric, x[left] + s * dx, y[left] + s * dy).height > altitude + 1e-9
        met[left[below]] = s
        left = left[~below & (altitude >= lowest if sinks else altitude < highest)]
    return met


def leaves(fabric, x, y, z, w, curvature=0.0, step=0.0025):
    """Say for each point (x, y, z) whether a march towards w leaves the cloth."""
    flat = math.hypot(w[0], w[1])
    return marched(fabric, x, y, z, (w[0] / flat, w[1] / flat, w[2] / flat, curvature), step) == NEVER
