import math
from functools import partial

import numpy as np
import pytest

from tests.presets import PRESETS
from weaves.draft import Matrix
from weaves.fabric import load_fabric
from weaves.mesh import repeat_mesh
from weaves.surface import GAP, surface_at

WIDTHS = [(1.0, 1.0), (1.0, 0.4), (0.55, 0.9)]


def _cloth(cloth, widths=(1.0, 1.0), warp=None, weft=None):
    fabric = load_fabric(cloth) if isinstance(cloth, str) else cloth
    changes = {"warp": {"width": widths[0], **(warp or {})}, "weft": {"width": widths[1], **(weft or {})}}
    return fabric.model_copy(update={y: getattr(fabric, y).model_copy(update=own) for y, own in changes.items()})


def _areas(mesh):
    """Return the area vector of every triangle and its corners."""
    corners = mesh.vertices[mesh.faces]
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2, corners


@pytest.mark.parametrize("widths", WIDTHS)
@pytest.mark.parametrize("name", PRESETS)
def test_every_vertex_lies_on_its_yarn_and_no_point_is_covered_twice(name, widths):
    fabric = _cloth(name, widths)
    mesh = repeat_mesh(fabric, 5)
    for family, yarn in enumerate((mesh.warp, mesh.weft)):
        x, y, z = yarn.vertices.T
        # On the border of a piece one of the four sides is its own; a yarn rises from its side as a square root.
        sides = [surface_at(fabric, x + dx, y + dy) for dx in (-1e-12, 1e-12) for dy in (-1e-12, 1e-12)]
        near = [(side.yarn == family) & (np.abs(side.height - z) < 1e-5) for side in sides]
        assert np.any(near, axis=0).all()
        inside = np.all([side.yarn == family for side in sides], axis=0) & (np.ptp([s.height for s in sides], 0) < 1e-9)
        assert inside.any()
        np.testing.assert_allclose(z[inside], surface_at(fabric, x, y).height[inside], rtol=0, atol=5e-6)
    # Projected areas are those of the drawing.
    over, (warp, weft) = fabric.weave.warp_over, widths
    areas = [_areas(part)[0][:, 2] for part in mesh]
    expected = [warp * (over + (1 - weft) * ~over).sum(), weft * (~over + (1 - warp) * over).sum(), 0.0]
    np.testing.assert_allclose([area.sum() for area in areas], expected, atol=1e-9)
    # Nothing hangs over, so equal areas mean that no point is covered twice.
    assert all((area > 0).all() for area in areas[:2])
    np.testing.assert_allclose(areas[2], 0, atol=1e-15)
    covered = np.concatenate([part.vertices for part in mesh[:2]])
    assert covered[:, :2].min() >= 0 and (covered[:, :2].max(axis=0) <= fabric.weave.repeat).all()


def _flux(mesh, axis, field):
    """Integrate n_x field(x, y) over a mesh, or n_y: the mid-points of the edges are exact for parabolas."""
    vectors, corners = _areas(mesh)
    middles = (corners + np.roll(corners, 1, axis=1)) / 2
    return float((vectors[:, axis, None] * field(middles) / 3).sum())


@pytest.mark.parametrize("widths", WIDTHS)
@pytest.mark.parametrize("name", PRESETS)
def test_walls_close_every_step(name, widths):
    """Green's theorem on a closed periodic height field: the integral of g n_x is that of height times dg/dx.

    Rationale: g is smooth and periodic, and a bump off every symmetry of the cloth, so that no missing, doubled or
    turned wall can hide. Tolerance: the quadrature's. g = 1 is exact, but for the tiny steps that are left open.
    """
    fabric = _cloth(name, widths)
    mesh = repeat_mesh(fabric, 16)
    wave = 2 * math.pi / np.array(fabric.weave.repeat)
    floor = min(part.vertices[:, 2].min() for part in mesh[:2])

    def bump(p):
        return np.exp(np.cos(wave[0] * p[..., 0] - 0.7) + np.cos(wave[1] * p[..., 1] - 1.9))

    def height_times_slope(p, axis):
        return -wave[axis] * np.sin(wave[axis] * p[..., axis] - (0.7, 1.9)[axis]) * bump(p) * (p[..., 2] - floor)

    for axis in (0, 1):
        standing = _flux(mesh.walls, axis, bump)
        expected = sum(_flux(part, 2, partial(height_times_slope, axis=axis)) for part in mesh[:2])
        assert sum(_flux(part, axis, bump) for part in mesh[:2]) + standing == pytest.approx(expected, abs=2e-5)
        assert abs(standing) > 1e-3
        assert sum(_flux(part, axis, lambda p: np.ones(p.shape[:-1])) for part in mesh) == pytest.approx(0, abs=1e-5)


@pytest.mark.parametrize("name", ["denim", "silk_shantung", "cotton_twill"])
def test_walls_fill_what_lies_between_both_sides_and_no_more(name):
    """Sides that cross leave two triangles between them, which a careless quadrangle would overlap.

    Expected: at every border of cells across x, the walls' area is the integral of the distance of the polylines in
    which the yarns' triangles end there, sampled finely; coarse meshes show most.
    """
    fabric = _cloth(name)
    mesh = repeat_mesh(fabric, 5)
    ends, picks = fabric.weave.repeat
    corners = np.concatenate([part.vertices[part.faces] for part in mesh[:2]])
    vectors, walls = _areas(mesh.walls)
    y = (np.arange(20_000 * picks) + 0.5) / 20_000

    def heights(border, leftwards):
        """Return the heights in which the triangles on one side of a border end."""
        there = (corners[..., 0] == border).sum(axis=1) == 2
        edges = corners[there & ((corners[..., 0].mean(axis=1) < border) == leftwards)]
        edges = edges[edges[..., 0] == border].reshape(-1, 2, 3)
        assert len(edges) == 5 * picks
        edges = np.take_along_axis(edges, np.argsort(edges[..., 1], axis=1)[..., None], axis=1)
        _, (y0, y1), (z0, z1) = edges[np.argsort(edges[:, 0, 1])].T
        index = np.searchsorted(y0, y) - 1
        return z0[index] + (z1 - z0)[index] * ((y - y0[index]) / (y1 - y0)[index])

    crossings = 0
    for border in range(ends):
        left, right = heights(border or ends, True), heights(border, False)
        here = (np.abs(vectors[:, 0]) > 0) & (walls[:, 0, 0] == border)
        area = np.abs(vectors[here, 0]).sum()
        assert area == pytest.approx(np.abs(left - right).mean() * picks, rel=1e-4, abs=1e-5)
        crossings += int((np.diff(np.sign(left - right)[np.abs(left - right) > 1e-5]) != 0).sum())
    assert crossings


@pytest.mark.parametrize(("steps", "width"), [(2, 0.6), (3, 1.0), (16, 0.6)])
def test_volume_of_straight_yarns_is_that_of_inscribed_prisms(steps, width):
    flat = {"bend": 0.0, "relief": 1.0}
    fabric = _cloth("denim", (width, width), flat, flat)
    mesh = repeat_mesh(fabric, steps)
    polygon = steps / 2 * math.sin(math.pi / steps) * (width / 2) ** 2
    over = fabric.weave.warp_over
    lengths = [(over + (1 - width) * ~over).sum(), (~over + (1 - width) * over).sum()]
    for part, length in zip(mesh[:2], lengths, strict=True):
        area, corners = _areas(part)
        volume = (area[:, 2] * corners[:, :, 2].mean(axis=1)).sum()
        assert volume == pytest.approx(polygon * length, rel=2e-5)


def test_walls_at_gaps_go_down_to_the_lowest_point_also_of_one_yarn_on_top():
    mesh = repeat_mesh(_cloth("polyester_lining", (0.5, 0.5)), 8)
    low = min(part.vertices[:, 2].min() for part in mesh[:2])
    corner = mesh.walls.vertices[np.isclose(mesh.walls.vertices[:, 0], 0.25) & (mesh.walls.vertices[:, 1] < 0.2)]
    assert len(corner) and corner[:, 2].min() == low == mesh.walls.vertices[:, 2].min()
    for row in ("#", "."):
        fabric = load_fabric("denim").model_copy(update={"draft": Matrix(rows=(row,))})
        full = repeat_mesh(fabric, 8)
        assert len(full.warp.faces if row == "#" else full.weft.faces) and not len(full.walls.faces)
        mesh = repeat_mesh(_cloth(fabric, (0.5, 0.5)), 8)
        assert sum(_areas(part)[0][:, 2].sum() for part in mesh[:2]) == pytest.approx(0.75)
        np.testing.assert_allclose(sum(_areas(part)[0].sum(axis=0) for part in mesh)[:2], 0, atol=1e-9)


def test_copies_are_the_repeat_moved_whose_mean_height_converges_to_the_surface():
    fabric = _cloth("denim", (0.8, 0.8))
    ends, picks = fabric.weave.repeat
    one, six = repeat_mesh(fabric, 4), repeat_mesh(fabric, 4, (3, 2))
    places = np.array([(i * ends, j * picks, 0) for j in range(2) for i in range(3)])
    for single, copies in zip(one, six, strict=True):
        expected = single.vertices[single.faces] + places[:, None, None]
        np.testing.assert_allclose(copies.vertices[copies.faces].reshape(expected.shape), expected)
    fabric = _cloth("denim", (0.8, 0.9))
    ends, picks = fabric.weave.repeat

    def volume(steps):
        return sum((a[:, 2] * c[:, :, 2].mean(axis=1)).sum() for a, c in map(_areas, repeat_mesh(fabric, steps)[:2]))

    finest = volume(128)
    errors = [volume(steps) - finest for steps in (8, 16, 32)]
    order = -np.polyfit(np.log([8, 16, 32]), np.log(np.abs(errors)), 1)[0]
    assert 1.8 < order < 2.2
    x, y = (np.arange(n * 200) / 200 + 1 / 400 for n in (ends, picks))
    surface = surface_at(fabric, x, y[:, None])
    expected = np.where(surface.yarn == GAP, 0.0, surface.height).mean() * ends * picks
    assert finest == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize("steps", [2, 7])
def test_triangles_are_never_degenerate(steps):
    for widths in WIDTHS:
        for part in repeat_mesh(_cloth("silk_shantung", widths), steps):
            vectors, _ = _areas(part)
            assert np.isfinite(part.vertices).all() and (np.linalg.norm(vectors, axis=1) > 0).all()
