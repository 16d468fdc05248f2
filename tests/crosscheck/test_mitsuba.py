"""The ground truth against Mitsuba 3, an independent renderer: whole patches, and the microflakes alone.

Mitsuba sees the cloth as triangles. A directional light and an orthographic camera, sheared so that its pixels cover
exactly one repeat amid enough copies of it, make the mean radiance of the picture the patch BSDF itself: Lambertian
yarns give C_warp and C_weft with w_d = 1, black walls cast their shadows, and pixels that see walls are left out of the
mean, which is what `normaliser = "visible"` says. Both yarns are rendered at once, the warp in red, the weft in green.

The variant is `scalar_rgb`: it needs no LLVM, which ends the process where it does not fit, and is fast enough.
"""

import math

import mitsuba as mi
import numpy as np
import pytest

from pipeline.truth.estimator import estimate
from pipeline.truth.geometry.heightfield import height_field
from pipeline.truth.geometry.pieces import reference_plane
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from pipeline.truth.scattering.slab import density, sigma
from tests.directions import unit
from tests.pipeline.truth.cloths import equal_queries, woven
from tests.presets import slow
from weaves.families import Satin, Twill
from weaves.mesh import repeat_mesh

pytestmark = pytest.mark.external  # another renderer

mi.set_variant("scalar_rgb")

SIDE = 512
SEEDS = range(4)
STEPS = 128
SCALE = 1000.0
"""Mitsuba starts its shadow rays (1 + |coordinate|) 9e-5 off the surface, which lets light in at grazing angles: at
unit scale .1 % too much at 80 degrees. In large units, about the origin, a third of it is left."""
TOLERANCE, FLOOR, ERRORS = 3e-3, 5e-6, 3.0
EXACT = TruthOptions(walls="left_out", relative_error=1e-5, min_count=1 << 20, max_count=1 << 20)

FABRICS = {
    "plain": ("polyester_lining", None, 22.0, 16.0),
    "twill": ("cotton_twill", Twill(over=(2,), under=(2,)), 24.0, 24.0),
    "satin": ("silk_charmeuse", Satin(ends=5, move=2), 35.0, 60.0),
}
SEEN = FABRICS | {"denim": ("denim", None, 12.0, 38.0), "gabardine": ("wool_gabardine", None, 30.0, 30.0)}
BLOCK = 16
"""Pixels of Mitsuba along a side of one of the pixels that are compared."""
# Polar and azimuth angle of wi, then of wo. A mirror pair cannot tell the two apart; the others can.
PAIRS = {
    "mirror": ((30, 30), (30, 210)),
    "across": ((60, 20), (20, 150)),
    "low_light": ((80, 20), (40, 110)),
    "low_viewer": ((40, 110), (80, 20)),
    "grazing": ((80, 0), (70, 180)),
}
FAST = {("plain", "across"), ("plain", "low_light")}


def _fabric(preset, draft, warp, weft):
    rows = draft and draft.build().rows()
    return woven(preset, rows, {"bend": warp}, {"bend": weft}, blend=1.0, width=1.0, relief=1.0)


def _shape(name, mesh, colour, centre):
    properties = mi.Properties()
    properties["face_normals"] = True
    properties["bsdf"] = mi.load_dict({"type": "diffuse", "reflectance": {"type": "rgb", "value": colour}})
    shape = mi.Mesh(name, len(mesh.vertices), len(mesh.faces), props=properties)
    parameters = mi.traverse(shape)
    parameters["vertex_positions"] = ((mesh.vertices - centre) * SCALE).astype(np.float32).ravel()
    parameters["faces"] = mesh.faces.astype(np.uint32).ravel()
    parameters.update()
    return shape


def _scene(fabric, wi, wo):
    """Return the scene of the first bounce; its picture has the colour of the yarn that is seen beside the light."""
    mesh = repeat_mesh(fabric, STEPS)
    parts = zip(("warp", "weft", "walls"), mesh, ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.0]), strict=True)
    path = {"type": "aov", "aovs": "seen:albedo", "direct": {"type": "path", "max_depth": 2}}
    return scene_of(fabric, wi, wo, list(parts), path, SIDE)


def scene_of(fabric, wi, wo, parts, integrator, side, margin=0.0):
    """Return one repeat of meshes (name, mesh, colour) about the origin, all copies that its rays meet, and a camera.

    Rays go on over a `margin` of yarns around.
    """
    extent = np.array(fabric.weave.repeat, np.float64)
    heights = np.concatenate([mesh.vertices[:, 2] for _, mesh, _ in parts])
    top, depth, centre = heights.max(), np.ptp(heights), np.array([*extent / 2, 0.0])
    # A ray goes down from the top along -wo and then up along wi, through no more than the depth of the cloth.
    down, up = -wo[:2] / wo[2] * depth, wi[:2] / wi[2] * depth
    reach, edge = np.stack([np.zeros(2), down, up, down + up]), margin + 1e-6 * extent
    first = np.floor((reach.min(axis=0) - edge) / extent).astype(int)
    last = np.floor((reach.max(axis=0) + edge) / extent + 1.0).astype(int)
    repeat = {name: _shape(name, mesh, colour, centre) for name, mesh, colour in parts if len(mesh.faces)}
    scene = {"type": "scene", "integrator": integrator, "repeat": {"type": "shapegroup"} | repeat}
    for i, j in np.ndindex(*(last - first + 1)):
        place = mi.ScalarTransform4f().translate([*(np.add(first, (i, j)) * extent * SCALE), 0.0])
        scene[f"copy_{i}_{j}"] = {"type": "instance", "to_world": place, "cloth": {"type": "ref", "id": "repeat"}}
    # Columns: where the camera's x, y and z point. Its rays start above the plane z = top and go along -wo.
    camera = np.eye(4)
    camera[:2, :2] = np.diag([-extent[0] / 2, extent[1] / 2]) * SCALE
    camera[:3, 2], camera[:3, 3] = -wo, np.array([0.0, 0.0, top * SCALE]) + wo
    film = {"type": "hdrfilm", "width": side, "height": side, "rfilter": {"type": "box"}}
    film |= {"pixel_format": "rgb", "component_format": "float32"}
    sensor = {"type": "orthographic", "near_clip": 1e-3, "far_clip": 1e3 * SCALE, "film": film}
    sensor |= {"to_world": mi.ScalarTransform4f(camera), "sampler": {"type": "independent", "sample_count": 1}}
    sun = {"type": "directional", "direction": (-wi).tolist(), "irradiance": {"type": "rgb", "value": 1.0}}
    return mi.load_dict(scene | {"light": sun, "sensor": sensor})


def _pictures(fabric, wi, wo, seeds=SEEDS):
    """Return radiance of warp and weft, and which of them is seen, as pictures (seeds, y, x, 2)."""
    scene = _scene(fabric, wi, wo)
    pictures = np.stack([np.array(mi.render(scene, spp=1, seed=seed))[..., :6] for seed in seeds]).astype(np.float64)
    # Every ray meets the cloth: one yarn in full, or a wall.
    yarns = pictures[..., 3:5]
    assert np.isin(yarns, (0.0, 1.0)).all() and yarns.sum(axis=-1).max() <= 1.0
    return pictures[..., :2], yarns


def _rendered(fabric, wi, wo):
    """Return C_warp and C_weft with their standard errors."""
    radiance, yarns = _pictures(fabric, wi, wo)
    runs = radiance.sum(axis=(1, 2)) / yarns.sum(axis=(1, 2, 3))[:, None]
    return runs.mean(axis=0), runs.std(axis=0, ddof=1) / math.sqrt(len(runs))


def _estimated(fabric, wi, wo):
    answer = estimate(fabric, equal_queries(wi, wo, 20 * max(fabric.weave.repeat)), EXACT, 1)
    return answer.mean[0, 2:4].astype(np.float64), answer.standard_error[0, 2:4].astype(np.float64)


@pytest.mark.parametrize(
    ("name", "pair"), [(name, pair) if (name, pair) in FAST else slow(name, pair) for name in FABRICS for pair in PAIRS]
)
def test_diffuse_components_are_those_of_a_rendering(name, pair):
    """Rationale: geometry, shadows, masks and normaliser, against code that shares none of it but the heights.

    Expected: equal within .3 % and 5e-6, and 3 standard errors of both. Meshes of 128 steps a yarn are within .15 % at
    80 degrees, where it is worst.
    """
    fabric = _fabric(*FABRICS[name])
    wi, wo = (unit(*angles) for angles in PAIRS[pair])
    rendered, rendered_error = _rendered(fabric, wi, wo)
    mean, error = _estimated(fabric, wi, wo)
    allowed = TOLERANCE * rendered + FLOOR + ERRORS * np.hypot(rendered_error, error)
    assert (np.abs(mean - rendered) <= allowed).all(), (mean, error, rendered, rendered_error)


@pytest.mark.parametrize(
    ("name", "degrees"),
    [(name, degrees) if name == "twill" else slow(name, degrees) for name in SEEN for degrees in (0, 45, 70)],
)
def test_a_picture_is_that_of_its_pixels_as_queries(name, degrees):
    """Rationale: where a viewer sees each point, and what is hidden; one repeat in 32 x 32 pixels.

    Expected: the root mean square over the pixels that see no wall is 1 % of their mean at most. Both renderings have
    about a thousand rays a pixel, whose noise is .2 %.
    """
    fabric = _fabric(*SEEN[name])
    wi, wo = unit(40, 110), unit(degrees, 20)
    radiance, yarns = _pictures(fabric, wi, wo)
    count = SIDE // BLOCK
    blocks = (len(SEEDS), count, BLOCK, count, BLOCK, 2)
    seen = yarns.reshape(blocks).sum(axis=(0, 2, 4, 5))
    whole = seen == len(SEEDS) * BLOCK * BLOCK
    rendered = (radiance.reshape(blocks).sum(axis=(0, 2, 4)).sum(axis=-1) / np.maximum(seen, 1))[whole]

    # The camera's pixels lie on the plane of the highest point, footprints on the reference plane; rows start on top.
    field, extent = height_field(fabric), np.array(fabric.weave.repeat)
    shift = (field.highest - reference_plane(field)) * wo[:2] / wo[2]
    row, column = np.nonzero(whole)
    u, v = (np.stack([column + 0.5, count - row - 0.5], axis=1) / count * extent - shift).T
    deviation = np.ones((len(u), 1)) * extent / count / math.sqrt(12.0)
    directions = (np.tile(w, (len(u), 1)) for w in (wi, wo))
    queries = Queries.round(u, v, deviation[:, 0], *directions)._replace(sigma_minor=np.float32(deviation[:, 1]))
    options = TruthOptions(estimator="owen", footprint="box", relative_error=0.005)
    answers = estimate(fabric, queries, options, 1).mean[:, 2:].sum(axis=1)
    assert whole.mean() > 0.5
    assert np.sqrt(np.mean((answers - rendered) ** 2)) < 0.01 * rendered.mean()


def _unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def _frame(tangent):
    """Return a rotation whose last row is the tangent."""
    across = _unit(np.cross(tangent, np.eye(3)[np.argmin(np.abs(tangent))]))
    return np.stack([across, np.cross(tangent, across), tangent])


@pytest.mark.parametrize("roughness", [0.05, 0.1, 0.3, 0.55, 1.0])
def test_microflakes_are_mitsubas_sggx(roughness):
    """Rationale: D and sigma by tangent alone, against Mitsuba's by matrix, S = diag(1, 1, alpha^2) along the fibre.

    Expected: phase function = D(h) / (4 sigma(wi)), pointwise to 1e-4, which is single precision: Mitsuba's matrix is
    given in the frame of the fibre, since turned to an oblique one its small entry would drown in the rounding.
    """
    random = np.random.default_rng(7)
    tangent, wi, wo = (_unit(random.normal(size=(256, 3))) for _ in range(3))
    entries = [1.0, 1.0, roughness**2, 0.0, 0.0, 0.0]
    grid = mi.VolumeGrid(np.array(entries, np.float32).reshape(1, 1, 1, 6))
    phase = mi.load_dict({"type": "sggx", "S": {"type": "gridvolume", "grid": grid}})
    shape, context, point = mi.SGGXPhaseFunctionParams(entries), mi.PhaseFunctionContext(), mi.MediumInteraction3f()
    point.p = mi.Point3f(0.5)
    for t, i, o in zip(tangent, wi, wo, strict=True):
        turn = _frame(t)
        half = _unit(i + o)
        ours_d, ours_sigma = density(*(i + o), *t, roughness), sigma(*i, *t, roughness)
        assert mi.sggx_pdf(mi.Vector3f(turn @ half), shape) == pytest.approx(ours_d, rel=1e-4)
        assert mi.sggx_projected_area(mi.Vector3f(turn @ i), shape) == pytest.approx(ours_sigma, rel=1e-4)
        point.wi = mi.Vector3f(turn @ i)
        point.sh_frame = mi.Frame3f(point.wi)
        value, pdf = phase.eval_pdf(context, point, mi.Vector3f(turn @ o))
        assert value[0] == pytest.approx(ours_d / (4 * ours_sigma), rel=1e-4)
        assert pdf == pytest.approx(value[0], rel=1e-4)
