import math
import traceback

import numpy as np
import pytest

from pipeline.analytic.coverage import quick_coverage
from pipeline.mitsuba import worn
from pipeline.mitsuba.integrator import MOST_SCATTER, _Cone, evaluated, ray_deviation
from pipeline.mitsuba.worn import PIXEL, footprints_of
from pipeline.scenes.frame import render
from pipeline.scenes.loading import load
from pipeline.scenes.options import SceneOptions
from pipeline.scenes.picture import sharpened
from pipeline.scenes.scene import Cloth, Scene
from pipeline.scenes.shipped import SHIPPED, wears
from tests.pipeline.mitsuba.conftest import NEEDS_LLVM
from weaves.errors import BadInput
from weaves.fabric import load_fabric

LAMP = {"type": "point", "position": [1.0, 1.0, 2.0], "intensity": 3.0}


def floor(mi, side=1.0, height=0.0):
    """Return a square floor seen from above; u, v run from 0 to 1."""
    to_world = mi.ScalarTransform4f().translate([0, 0, height]).scale(side)
    return {"type": "rectangle", "to_world": to_world, "bsdf": {"type": "diffuse"}}


def sensor(mi, size=8, samples=4, rfilter="box"):
    look = mi.ScalarTransform4f().look_at([0, -1, 4], [0, 0, 0], [0, 1, 0])
    film = {"type": "hdrfilm", "width": size, "height": size, "rfilter": {"type": rfilter}}
    sampler = {"type": "independent", "sample_count": samples}
    return {"type": "perspective", "fov": 30, "to_world": look, "film": film, "sampler": sampler}


def path(mi, kind="twillight_path", **properties):
    return mi.load_dict({"type": kind, **properties})


def jacobian(si):
    return np.stack([np.asarray(change, np.float64).reshape(2) for change in (si.duv_dx, si.duv_dy)], axis=-1)[None]


@pytest.mark.parametrize(("rfilter", "samples"), [("box", 1), ("box", 64), ("gaussian", 4), ("tent", 4)])
def test_filter_and_footprint_together_are_one_pixel(scalar, rfilter, samples):
    """Variances: box 1/12, tent 1/6, Mitsuba's Gaussian .25 but for its tails."""
    spread = {"box": 1 / 12, "tent": 1 / 6, "gaussian": 0.25}[rfilter]
    found = ray_deviation(scalar.load_dict({"type": rfilter}), samples)
    wanted = math.sqrt(max(PIXEL**2 - spread, PIXEL**2 / max(samples, 4)))
    assert found == pytest.approx(wanted, rel=1e-3)


def test_first_footprints_are_those_of_the_gbuffer_and_hidden_lights_are_hidden(scalar):
    """Rays through the middles of pixels of the scene `drape`; both know places in single precision."""
    loaded, size = load(SHIPPED["drape"], SceneOptions(variant="scalar_rgb", curvature="none")), (24, 18)
    gbuffer = render(loaded, size=size).gbuffers["wool_gabardine"]
    camera = loaded.camera.sensor(scalar, size)
    for index in range(0, len(gbuffer.pixel), 17):
        row, column = divmod(int(gbuffer.pixel[index]), size[0])
        place = [(column + 0.5) / size[0], (row + 0.5) / size[1]]
        ray, _ = camera.sample_ray_differential(0.0, 0.5, place, [0.5, 0.5])
        si = loaded.world.ray_intersect(ray)
        _Cone().meet(ray, si)
        sigma, sigma_minor, _ = footprints_of(jacobian(si) * 80.0)
        wanted = (gbuffer.sigma[index], gbuffer.sigma_minor[index])
        np.testing.assert_allclose((sigma[0], sigma_minor[0]), wanted, rtol=2e-2)
    scene = scalar.load_dict({"type": "scene", "sky": {"type": "constant"}, "sensor": sensor(scalar, 2)})
    shown, hidden = (
        np.asarray(scalar.render(scene, integrator=path(scalar, hide_emitters=hide), spp=1)) for hide in (False, True)
    )
    assert (shown[..., :3] == 1.0).all() and (hidden[..., :3] == 0.0).all()


def test_a_bounce_widens_the_footprint_and_a_rare_direction_no_more_than_an_even_one(scalar):
    """A ray straight down four units to a floor and up again two units to a ceiling of side 2, u from 0 to 1. Its cone
    is PIXEL * .01 wide for every unit of way; the bounce, of density 3, adds 2 / sqrt(4 pi 3)."""
    mi = scalar
    scene = mi.load_dict({"type": "scene", "floor": floor(mi), "ceiling": floor(mi, height=2.0)})
    bottom = mi.load_dict({"type": "scene", "floor": floor(mi)})
    ray = mi.RayDifferential3f(mi.Point3f(0.1, 0.2, 4.0), mi.Vector3f(0, 0, -1))
    ray.o_x = ray.o_y = ray.o
    ray.d_x, ray.d_y, ray.has_differentials = mi.Vector3f(0.01, 0, -1), mi.Vector3f(0, 0.01, -1), True
    cone = _Cone()
    si = bottom.ray_intersect(ray)
    cone.meet(ray, si)
    np.testing.assert_allclose(footprints_of(jacobian(si))[0], PIXEL * 0.04 / 2.0, rtol=1e-4)
    for delta, widened in ((True, 0.0), (False, 2.0 / math.sqrt(4.0 * math.pi * 3.0))):
        cone = _Cone()
        cone.meet(ray, si)
        cone.scatter(mi.Float(3.0), delta)
        up = mi.RayDifferential3f(si.spawn_ray(mi.Vector3f(0, 0, 1)))
        met = scene.ray_intersect(up)
        cone.meet(up, met)
        wanted = math.hypot(PIXEL * 0.06, widened) / 2.0
        sigma, sigma_minor, _ = footprints_of(jacobian(met))
        np.testing.assert_allclose((sigma[0], sigma_minor[0]), wanted, rtol=1e-3)
    import drjit as dr

    cone = _Cone()
    cone.meet(scalar.RayDifferential3f(), dr.zeros(scalar.SurfaceInteraction3f))
    cone.scatter(1e-9, False)
    assert cone.state[-1] == pytest.approx(math.sqrt(MOST_SCATTER))


def test_light_transport_is_that_of_mitsubas_path_tracer(mi):
    """Two floors, a ball that is half there, a lamp and an even sky: means of 8 pictures, tests at .1 % together. Each
    emitter is sampled, or a random one as it is weighted. Two lamps give the sum of their lights, without noise."""
    ball = {"type": "sphere", "radius": 0.9, "bsdf": {"type": "mask", "opacity": 0.5, "nested": {"type": "diffuse"}}}
    floors = {"floor": floor(mi, 2.0), "shelf": floor(mi, 0.5, 0.6), "ball": ball}
    means, errors = [], []
    # In evaluated loops `path` of Mitsuba 3.9.1 loses light.
    theirs = "path" if mi.variant().startswith("scalar") else "prb"
    for kind, samples, weight in (("twillight_path", 4, 1.0), ("twillight_path", 4, 0.5), (theirs, 256, 1.0)):
        sky = {"type": "constant", "radiance": 0.3, "sampling_weight": weight}
        scene = mi.load_dict({"type": "scene", **floors, "sky": sky, "lamp": LAMP, "sensor": sensor(mi)})
        tracer = path(mi, kind, max_depth=4)
        with evaluated():  # cloth of other tests may still be in memory
            pictures = [mi.render(scene, integrator=tracer, spp=samples, seed=k) for k in range(8)]
        found = [float(np.asarray(picture).mean()) for picture in pictures]
        means.append(np.mean(found))
        errors.append(np.std(found, ddof=1) / math.sqrt(8))
    for mean, error in zip(means[:2], errors[:2], strict=True):  # t of 7 degrees of freedom at .05 %, two-sided
        assert abs(mean - means[2]) < 6.1 * math.hypot(error, errors[2])
        assert error < 0.1 * mean
    lamps = [{"lamp": LAMP}, {"other": LAMP | {"position": [-1.0, 0.5, 2.0]}}]
    rooms = ({"type": "scene", **floors, **lit, "sensor": sensor(mi, 1, 1)} for lit in (lamps[0] | lamps[1], *lamps))
    both, *alone = (mi.render(mi.load_dict(room), integrator=path(mi, max_depth=2), seed=3) for room in rooms)
    np.testing.assert_allclose(both, np.sum(alone, axis=0), rtol=1e-5)


@NEEDS_LLVM
@pytest.mark.parametrize("kind", ["prb", "direct"])
def test_mitsubas_own_integrators_show_cloth_where_they_are_evaluated(llvm, kind):
    """Direct light alone, with a footprint that all know, and the same random numbers: the same picture."""
    cloth = {**floor(llvm, 0.8), "bsdf": {"type": "twillight", "fabric": "denim", "yarns": 10.0, "sigma": 0.5}}
    scene = llvm.load_dict({"type": "scene", "cloth": cloth, "lamp": LAMP, "sensor": sensor(llvm)})
    other = path(llvm, kind, **({"max_depth": 2} if kind == "prb" else {}))
    with pytest.raises(BadInput, match=r"use the integrator twillight_path; direct .*evaluated\(\):") as caught:
        llvm.render(scene, integrator=other, spp=1)
    assert "error while performing" not in "".join(traceback.format_exception(caught.value))
    ours = np.asarray(llvm.render(scene, integrator=path(llvm, max_depth=2), spp=4))[..., :3]
    with evaluated():
        theirs = np.asarray(llvm.render(scene, integrator=other, spp=4))[..., :3]
    assert ours.mean() > 0.001
    np.testing.assert_allclose(ours, theirs, rtol=1e-4, atol=1e-6)


@NEEDS_LLVM
@pytest.mark.parametrize("kind", ["path", "volpath"])
def test_a_scene_without_cloth_is_that_of_before_while_cloth_is_in_memory(llvm, kind):
    scene = llvm.load_dict({"type": "scene", "floor": floor(llvm), "lamp": LAMP, "sensor": sensor(llvm)})
    before = np.asarray(llvm.render(scene, integrator=path(llvm, kind)))
    kept = llvm.load_dict({"type": "twillight", "fabric": "denim"})
    after = np.asarray(llvm.render(scene, integrator=path(llvm, kind)))
    assert kept is not None and before.mean() > 0.01
    np.testing.assert_allclose(after, before, rtol=1e-5)


@pytest.mark.parametrize(("uv", "words"), [(False, "needs uv coordinates"), (True, "needs vertex normals")])
def test_a_mesh_without_uv_or_curvature_is_one_sentence(scalar, uv, words):
    mi = scalar
    settings = mi.Properties()
    settings["bsdf"] = mi.load_dict({"type": "twillight", "fabric": "denim"})
    mesh = mi.Mesh("bare", vertex_count=4, face_count=2, props=settings, has_vertex_texcoords=uv)
    found = mi.traverse(mesh)
    found["vertex_positions"], found["faces"] = [0, 0, 0, 1, 0, 0, 1, 1, 1, 0, 1, 0], [0, 1, 2, 0, 2, 3]
    if uv:
        found["vertex_texcoords"] = [0, 0, 1, 0, 1, 1, 0, 1]
    found.update()
    scene = mi.load_dict({"type": "scene", "mesh": mesh, "sky": {"type": "constant"}, "sensor": sensor(mi)})
    with pytest.raises(BadInput, match=words):
        mi.render(scene, integrator=path(mi), spp=1)


@pytest.mark.external
@NEEDS_LLVM
def test_rays_pass_a_silhouette_and_the_shape_behind_it(llvm, monkeypatch):
    """A tube of black cloth, too thick to shine through, before a white sky: a row shows 1 less its coverage. Coverage
    is that of the scene's renderer with 16 rays a pixel; a row has 24 pixels of 64 samples, 0 or 1 each."""
    denim, radius, spacing, size = load_fabric("denim"), 0.5, 0.0625, 24
    black = {"specular": (0.0,) * 3, "diffuse": (0.0,) * 3, "diffuse_transmission": (0.0,) * 3}
    yarns = {side: getattr(denim, side).model_copy(update=black) for side in ("warp", "weft")}
    monkeypatch.setattr(worn, "load_fabric", lambda name: denim.model_copy(update={**yarns, "optical_thickness": 50.0}))
    cloth = Cloth(yarns=(2.0 * math.pi * radius / spacing, 8.0 / spacing))

    def scene(mi, bsdf):
        look = mi.ScalarTransform4f().look_at([0, -3, radius], [0, 0, radius], [0, 0, 1])
        to_world = look @ mi.ScalarTransform4f().scale([0.1, 0.1, 1])
        camera = sensor(mi, size, 64) | {"type": "orthographic", "to_world": to_world}
        del camera["fov"]
        return {
            "type": "scene",
            "sky": {"type": "constant", "radiance": 1.0},
            "roll": {"type": "cylinder", "p0": [-4, 0, 0], "p1": [4, 0, 0], "radius": radius, "bsdf": bsdf},
            "camera": camera,
        }

    options = SceneOptions(variant="llvm_ad_rgb", environment_directions=4)
    loaded = sharpened(
        load(Scene(name="tube", source=lambda mi: scene(mi, wears("denim")), cloths={"denim": cloth}), options), 4
    )
    gbuffer = render(loaded, size=(4 * size, 4 * size)).gbuffers["denim"]
    covered = np.zeros(gbuffer.mask.size)
    covered[gbuffer.pixel] = gbuffer.coverage(quick_coverage(denim, gbuffer.rims(denim.repeat)))
    expected = 1.0 - covered.reshape(size, -1).mean(axis=1)

    plugin = {"type": "twillight", "fabric": "denim", "yarns": cloth.yarns[0], "yarns_v": cloth.yarns[1]}
    world = llvm.load_dict(scene(llvm, plugin))
    shown = np.asarray(llvm.render(world, integrator=path(llvm, max_depth=8)))[..., 0].mean(axis=1)
    assert ((expected > 0.1) & (expected < 0.9)).any()
    np.testing.assert_allclose(shown, expected, atol=4.0 * 0.5 / math.sqrt(24 * 64) + 0.01)
