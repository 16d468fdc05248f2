import math

import numpy as np
import pytest

from pipeline.analytic.soft_horizons import AZIMUTHS
from pipeline.analytic.soft_nodes.nodes import LEVELS
from pipeline.materials.lobes import even_sky
from pipeline.materials.occlusion import _horizon_map, lit_coverage
from pipeline.materials.planes import layout
from pipeline.truth.cloth import cloth_side
from pipeline.truth.geometry.heightfield import GAP, height_field, surface_at
from pipeline.truth.geometry.march import ray
from pipeline.truth.geometry.visibility import visible
from pipeline.truth.options import TruthOptions
from tests.pipeline.analytic.methods import soft_table
from tests.pipeline.truth.cloths import woven
from weaves.fabric import load_fabric


@pytest.mark.parametrize("name", ["satin_8", "gauze", "crepe"])
def test_occlusion_is_the_share_of_an_even_sky_whose_rays_leave_the_cloth(name):
    """Rays are traced by another kernel, without horizons; nodes and rays are each good to .02 of a share."""
    fabric = load_fabric(name)
    field, shown = height_field(fabric), layout(fabric, 256)
    lit, sky = lit_coverage(fabric, shown), even_sky(256)
    drawn = np.random.default_rng(3)
    errors = []
    for row, column in zip(drawn.integers(shown.height, size=80), drawn.integers(shown.width, size=80), strict=True):
        x, y = (column + 0.5) * shown.ends / shown.width, (row + 0.5) * shown.picks / shown.height
        family, side, z, *axes = surface_at(field, x, y, int(x), int(y))
        if family == GAP:
            assert lit[row, column] == 0.0
            continue
        n = np.array(axes[:3])
        first = np.array([n[2], 0.0, -n[0]]) / math.hypot(n[0], n[2])
        rays = sky @ np.stack([first, np.cross(n, first), n])
        seen = [visible(field, x, y, z, side, ray(*w, 0.0)) for w in rays]
        errors.append(lit[row, column] - np.mean(seen))
    assert len(errors) > 20 and np.abs(np.mean(errors)) < 0.012
    # Narrow steps at the ends of floats lie between nodes.
    assert np.mean(np.abs(errors)) < 0.02


def tangent_sine(v, x, beta):
    """Return the sine of elevation of the next cylinder, at distance 1, from angle v of one of radius 1/2. In the plane
    across the yarns, stretched by beta; along them a slope is less by the cosine to that plane."""
    across, up = 0.5 * np.sin(v) * np.sign(x), 0.5 * np.cos(v)
    elevation = np.arctan2(-up, 1.0 - across) + np.arcsin(0.5 / np.hypot(1.0 - across, up))
    slope = np.maximum(beta * np.tan(elevation) * abs(x), 0.0)
    return slope / np.hypot(1.0, slope)


def error_above_own_plane(sines, v, x, beta):
    """Return by how much horizons err at most and in the mean, where they count: above the point's tangent plane."""
    slope = np.maximum(-beta * np.tan(v) * x, 0.0)
    own = slope / np.hypot(1.0, slope)
    error = np.abs(np.maximum(sines, own) - np.maximum(tangent_sine(v, x, beta), own))
    return error.max(), error.mean()


@pytest.mark.parametrize("rows", [("##", "##"), ("..", "..")], ids=["warps", "wefts"])
@pytest.mark.parametrize("relief", [1.0, 0.5, 1.4])
def test_the_map_and_the_grid_have_the_tangents_of_cylinders(rows, relief):
    """The map to the root's tolerance; grids have 255 levels, between azimuths that are even in the angle."""
    fabric = woven("denim", rows, width=1.0, relief=relief)
    model, size, azimuths = cloth_side(fabric, TruthOptions()), 12, 32
    table = _horizon_map(model.front, model.back, size, azimuths)
    v = np.pi * ((np.arange(size) + 0.5) / size - 0.5)
    own = table.horizon[table.blocks[0] :][: azimuths * size * size].reshape(azimuths, size, size)
    for azimuth, sines in enumerate(own):
        angle = 2.0 * np.pi * azimuth / azimuths
        x, y = np.cos(angle), np.sin(angle)
        if rows[0] == "..":
            x, y = y, x
        # Blocks run across the yarn fastest.
        worst, mean = error_above_own_plane(sines, v[None, :], x, relief)
        assert worst < 5e-3 and mean < 5e-4

    grid = soft_table(fabric).grid[0] / LEVELS
    v = np.pi * ((np.arange(grid.shape[-1]) + 0.5) / grid.shape[-1] - 0.5)
    for azimuth, sines in enumerate(grid):
        t = 4.0 * azimuth / AZIMUTHS
        y = 1.0 - t if t <= 2.0 else t - 3.0
        x = (1.0 if t <= 2.0 else -1.0) * (1.0 - abs(y))
        x, y = np.array([x, y]) / np.hypot(x, y)
        if rows[0] == "..":
            x, y, sines = y, x, sines.T
        worst, mean = error_above_own_plane(sines, v[None, :], x, relief)
        assert worst < 0.04 and mean < 3e-3
