"""Directions by angles, and even over the sphere."""

import math

import numpy as np


def unit(degrees, azimuth):
    """Return a direction, from its angle to the normal and its azimuth in degrees."""
    theta, phi = math.radians(degrees), math.radians(azimuth)
    return np.array([math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)])


def above(x, y):
    """Return the unit direction in front with these components."""
    return np.array([x, y, math.sqrt(1.0 - x * x - y * y)])


def sphere(rows, columns):
    """Return the middles of cells of equal solid angle, cosine by azimuth, (rows columns, 3)."""
    z = -1.0 + 2.0 * (np.arange(rows) + 0.5) / rows
    turn = 2.0 * math.pi * (np.arange(columns) + 0.5) / columns
    sine = np.sqrt(1.0 - z * z)[:, None]
    return np.stack(np.broadcast_arrays(sine * np.cos(turn), sine * np.sin(turn), z[:, None]), axis=-1).reshape(-1, 3)
