import math

import numpy as np
import pytest

from pipeline.materials.lobes import even_sky
from pipeline.materials.occlusion import lit_coverage
from pipeline.materials.planes import layout
from pipeline.truth.geometry.heightfield import GAP, height_field, surface_at
from pipeline.truth.geometry.march import ray
from pipeline.truth.geometry.visibility import visible
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
