"""Whole yarns: against the height field of floats, and in Mitsuba."""

import math

import numpy as np
import pytest

from pipeline.truth.geometry.heightfield import GAP, TOP, WARP, height_field, surface_at
from tests.directions import unit
from tests.presets import slow
from tests.whole_yarns import envelope, tube_distance, tube_surface, tubes_met
from weaves.fabric import load_fabric

ALONG, AROUND, REACH = 16, 64, 6
"""Steps of the mesh along a cell and around a yarn; yarns and cells beyond the repeat."""


@pytest.mark.parametrize("name", ["denim", "voile", "silk_shantung"])
def test_floats_are_parts_of_whole_yarns(name):
    """Expected: every point of a float on top lies on the tube of its yarn, with the same normal and tangent.

    Seen from above nothing is higher than the envelope of the tubes, which is on a tube everywhere.
    """
    field, repeat = height_field(load_fabric(name)), load_fabric(name).weave.repeat
    tops = 0
    for x, y in np.random.default_rng(3).random((500, 2)) * repeat:
        family, side, z, *frame = surface_at(field, x, y, int(x), int(y))
        highest, seen = envelope(field, x, y)
        assert (family == GAP) == (seen == GAP)
        if family == GAP:
            continue
        assert tube_distance(field, seen, int(x if seen == WARP else y), x, y, highest) == pytest.approx(0.0, abs=1e-9)
        if side == TOP:
            column = int(x if family == WARP else y)
            assert tube_distance(field, family, column, x, y, z) == pytest.approx(0.0, abs=1e-9)
            assert tube_surface(field, family, column, x, y, z) == pytest.approx(frame, abs=1e-7)
            assert z < highest + 1e-9
            tops += 1
    assert tops > 200


def _line(over, bend, first, last):
    """Return a centre line from cell `first` to `last` as (along, z, inclination), by the floats of a yarn in turn."""
    points, k = [], first
    while over(k) == over(k - 1):
        k -= 1
    while k < last:
        length = 1
        while over(k + length) == over(k):
            length += 1
        u = np.linspace(-bend, bend, ALONG * length, endpoint=False)
        radius, sign = length / (2.0 * math.sin(bend)), 1.0 if over(k) else -1.0
        height = sign * radius * (np.cos(u) - math.cos(bend))
        points.append(np.stack([k + length / 2 + radius * np.sin(u), height, sign * u], axis=1))
        k += length
    return np.concatenate(points)


def _mesh(fabric):
    """Return vertices and triangles of all yarns about a repeat."""
    warp_over, vertices, triangles, count = fabric.weave.warp_over, [], [], 0
    picks, ends = warp_over.shape
    turn = np.arange(AROUND) * 2.0 * math.pi / AROUND
    for yarn, own, across, along in ((fabric.warp, warp_over.T, ends, picks), (fabric.weft, ~warp_over, picks, ends)):
        for column in range(-REACH, across + REACH):
            over = own[column % across]
            s, z, slope = _line(
                lambda k, over=over, along=along: over[k % along], math.radians(yarn.bend), -REACH, along + REACH
            ).T[:, :, None]
            lift = 0.5 * yarn.width * np.cos(turn)
            aside = np.broadcast_to(column + 0.5 + 0.5 * yarn.width * np.sin(turn), (len(s), AROUND))
            points = [aside, s + lift * np.sin(slope), z + lift * np.cos(slope)]
            if yarn is fabric.weft:
                points[:2] = points[1], points[0]
            vertices.append(np.stack(points, axis=-1).reshape(-1, 3))
            ring, place = np.arange(len(s) - 1)[:, None] * AROUND + count, np.arange(AROUND)
            a, b = ring + place, ring + (place + 1) % AROUND
            corners = [a, b, b + AROUND, a, b + AROUND, a + AROUND]
            triangles.append(np.stack(corners, axis=-1).reshape(-1, 3))
            count += len(vertices[-1])
    return np.concatenate(vertices), np.concatenate(triangles)


@pytest.mark.external
@pytest.mark.parametrize(("name", "degrees"), [("voile", 60), slow("denim", 30), slow("satin_8", 70)])
def test_rays_meet_tubes_where_they_meet_a_mesh(name, degrees):
    """Expected: no ray meets one and not the other; where both do, within the sagitta of the mesh's sides.

    That is .0006 yarn across and less along, over the cosine of the ray to the surface: within .01 for 19 rays of 20. A
    ray may pass a silhouette of one and not of the other: one of 200.
    """
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    fabric = load_fabric(name)
    field, wo = height_field(fabric), unit(degrees, 20)
    vertices, triangles = _mesh(fabric)
    mesh = mi.Mesh("yarns", len(vertices), len(triangles))
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = vertices.astype(np.float32).ravel()
    parameters["faces"] = triangles.astype(np.uint32).ravel()
    parameters.update()
    scene = mi.load_dict({"type": "scene", "yarns": mesh})
    start = np.random.default_rng(1).random((2000, 2)) * fabric.weave.repeat
    own = np.array([tubes_met(field, x, y, field.highest, *-wo) for x, y in start])
    other = np.array(
        [scene.ray_intersect(mi.Ray3f([x, y, field.highest], (-wo).tolist())).t for x, y in start], np.float64
    )
    met = np.isfinite(own)
    assert np.mean(met != np.isfinite(other)) <= 0.001
    apart = np.abs(own - other)[met & np.isfinite(other)]
    assert np.quantile(apart, 0.95) < 0.01
    assert np.mean(apart > 0.05) < 0.005
