"""All bounces between yarns against a path tracer on the triangles of the cloth.

Walls between floats have the colour of the yarn above; pixels that see walls are left out of the mean, as in
`test_mitsuba`. A render has three channels: three albedos of all yarns at once, or two mixed ones.
"""

import mitsuba as mi
import numpy as np
import pytest

from pipeline.analytic.bounces.table import bounce_table, bounced
from tests.crosscheck.test_mitsuba import SEEN, _estimated, _fabric, scene_of
from tests.directions import unit
from weaves.mesh import Mesh, repeat_mesh
from weaves.surface import surface_at

pytestmark = pytest.mark.external  # another renderer

SIDE, STEPS, MARGIN = 320, 96, 4.0
SEEDS = (0, 1)
# Polar and azimuth angle of wi, then of wo.
PAIRS = (
    ((30, 30), (30, 210)), ((60, 20), (20, 150)), ((80, 20), (40, 110)), ((40, 110), (80, 20)),
    ((80, 0), (70, 180)), ((0, 0), (45, 60)), ((45, 60), (0, 0)), ((70, 300), (60, 250)),
)  # fmt: skip
GREY, MIXED = ((0.3, 0.6, 0.9), (0.3, 0.6, 0.9)), ((0.9, 0.2, 0.0), (0.2, 0.9, 0.0))
"""Albedos of warp and weft in the three channels."""


def _walls_of_yarns(fabric, walls):
    """Return the walls of warps and those of wefts: a wall is the end of the yarn behind it."""
    corners = walls.vertices[walls.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    corners, normal = corners[length[:, 0] > 0], (normal / np.maximum(length, 1e-300))[length[:, 0] > 0]
    x, y, _ = (corners.mean(axis=1) - 1e-6 * normal).T
    family = surface_at(fabric, x, y).yarn
    parts = (corners[family == k] for k in (0, 1))
    return [Mesh(part.reshape(-1, 3), np.arange(3 * len(part)).reshape(-1, 3)) for part in parts]


def _scene(fabric, wi, wo, colours):
    """Return the scene of all bounces, whose light comes from a few yarns around."""
    mesh = repeat_mesh(fabric, STEPS)
    meshes = [mesh.warp, mesh.weft, *_walls_of_yarns(fabric, mesh.walls)]
    parts = [(f"part_{k}", part, list(colours[k % 2])) for k, part in enumerate(meshes)]
    path = {"type": "path", "max_depth": -1, "rr_depth": 100_000}
    integrator = {"type": "aov", "aovs": "n:geo_normal", "all": path}
    return scene_of(fabric, wi, wo, parts, integrator, SIDE, MARGIN)


def _rendered(fabric, wi, wo, colours):
    scene, values = _scene(fabric, wi, wo, colours), []
    for seed in SEEDS:
        picture = np.array(mi.render(scene, spp=1, seed=seed))[..., :6].astype(np.float64)
        seen = np.abs(picture[..., 5]) > 1e-6  # walls have level normals
        values.append(picture[seen][:, :3].mean(axis=0))
    return np.mean(values, axis=0)


def _errors(fabric, pairs, all_colours):
    """Return relative errors of one bounce and of all, (2, channels of all colours and pairs)."""
    table, errors = bounce_table(fabric), []
    for pair in pairs:
        wi, wo = (unit(*angles) for angles in pair)
        components, _ = _estimated(fabric, wi, wo)
        for colours in map(np.array, all_colours):
            later = bounced(table, np.float32(wi)[None], np.float32(wo)[None], colours)[0]
            rendered = _rendered(fabric, wi, wo, colours.tolist())
            both = np.stack([components @ colours, ((components[:, None] + later) * colours).sum(axis=0)])
            errors.append((both / np.maximum(rendered, 1e-9) - 1.0)[:, rendered > 0.0])
    return np.concatenate(errors, axis=1)


def _rms(errors):
    return np.sqrt(np.mean(errors**2, axis=-1))


def test_all_bounces_of_a_plain_weave_are_those_of_a_path_tracer():
    """Expected: within 1 % rms; one bounce lacks more than a tenth of the light of white yarns."""
    one, every = _errors(_fabric(*SEEN["plain"]), PAIRS[:2], (GREY,))
    assert _rms(every) < 0.01 and one[[2, 5]].max() < -0.1


@pytest.mark.slow
def test_all_bounces_are_those_of_a_path_tracer():
    """Five fabrics, albedos .3, .6, .9 and .9 beside .2, eight pairs of directions. Expected: within 1 % rms."""
    errors = [_errors(_fabric(*numbers), PAIRS, (GREY, MIXED))[1] for numbers in SEEN.values()]
    assert _rms(np.concatenate(errors)) < 0.01, [_rms(own) for own in errors]
