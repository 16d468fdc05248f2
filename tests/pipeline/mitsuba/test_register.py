import math

import numpy as np
import pytest
from scipy import ndimage

from pipeline.mitsuba import register as module
from pipeline.mitsuba.register import dress
from pipeline.mitsuba.worn import PIXEL
from pipeline.models.named import named_method
from pipeline.scenes.loading import load
from pipeline.scenes.options import SceneOptions
from pipeline.scenes.shipped import SHIPPED
from tests.pipeline.mitsuba.conftest import NEEDS_LLVM
from tests.pipeline.scenes.test_picture import whole
from tests.presets import slow
from tests.refusals import refusal

METHOD = "soft_nodes:2"


def sunlit(name, variant, sky=False):
    """Return the cloth of a shipped scene by the sun alone, or by sun and sky; footprints of `twillight_path`. What
    lies below the cloth is left out: our renderer shows it through the cloth, but unshadowed."""
    scene = SHIPPED[name]

    def build(mi):
        left_out = ("below", "core") if sky else ("sky", "below", "core")
        return {key: part for key, part in scene.source(mi).items() if key not in left_out}

    # A box filter adds 1/12 to the variance of a ray's footprint.
    options = SceneOptions(variant=variant, curvature="at_point", pixel_sigma=math.sqrt(PIXEL**2 - 1 / 12))
    return load(scene.model_copy(update={"source": build}), options)


def own_picture(loaded, size):
    return whole(loaded, named_method(METHOD, "test", "method"), size=size)[0]["rgb"]


def traced(loaded, size, samples=1, seed=0, depth=2):
    """Return the picture of rays through the middles of pixels, or of several rays a pixel."""
    mi, world = loaded.mi, dress(loaded, METHOD)
    camera = loaded.camera.sensor(mi, size)
    tracer = mi.load_dict({"type": "twillight_path", "max_depth": depth})
    if samples > 1:
        film = {"type": "hdrfilm", "width": size[0], "height": size[1], "rfilter": {"type": "box"}}
        settings = {"type": "perspective", **loaded.camera.settings, "film": film}
        camera = mi.load_dict(settings | {"to_world": mi.ScalarTransform4f(loaded.camera.to_world)})
    return np.asarray(mi.render(world, sensor=camera, integrator=tracer, spp=samples, seed=seed))[..., :3]


@pytest.mark.parametrize(("name", "size"), [("sphere", (16, 12)), slow("plane", (24, 18)), slow("drape", (24, 18))])
def test_each_pixel_is_that_of_our_renderer(use, name, size):
    """One ray a pixel and one light: nothing is random. Footprints differ by the near plane, some .2 %. At the border
    of a shadow and at a silhouette, rays start at other distances from the surface: one pixel in 50."""
    use("scalar_rgb")
    wanted, found = (take(sunlit(name, "scalar_rgb"), size) for take in (own_picture, traced))
    apart = np.abs(found - wanted).max(axis=-1) / wanted.mean()
    assert wanted.mean() > 0.01
    assert np.quantile(apart, 0.98) < 0.02
    assert np.sqrt(np.mean(np.square(np.sort(apart.ravel())[: -apart.size // 50]))) < 0.005


@pytest.mark.slow
@NEEDS_LLVM
@pytest.mark.parametrize("name", ["plane", "sphere"])
def test_sun_and_sky_are_those_of_our_renderer(use, name):
    """Cloth in pictures of eight seeds: its mean is that of our renderer within 4.5 standard errors and .5 %. The half
    per cent is for our renderer's lattice of directions. It traces one ray a pixel, so pixels beside the sky are left
    out. `drape` is left out: our renderer shows no cloth behind cloth."""
    use("llvm_ad_rgb")
    size = (24, 18)
    wanted = own_picture(sunlit(name, "llvm_ad_rgb", sky=True), size)
    cloth = ndimage.binary_erosion((wanted != wanted[0, 0]).any(axis=-1), np.ones((3, 3)), border_value=1)
    assert cloth.mean() > 0.2
    found = [traced(sunlit(name, "llvm_ad_rgb", sky=True), size, 256, seed)[cloth].mean() for seed in range(8)]
    apart = abs(np.mean(found) - wanted[cloth].mean())
    assert apart < 4.5 * np.std(found, ddof=1) / math.sqrt(8) + 0.005 * wanted[cloth].mean()


def test_without_llvm_the_scalar_variant_is_used_and_said(monkeypatch):
    monkeypatch.setattr(module, "llvm_works", lambda: True)
    assert module.best_variant() == "llvm_ad_rgb"
    monkeypatch.setattr(module, "llvm_works", lambda: False)
    with pytest.warns(UserWarning, match=r"apt install libllvm19.*DRJIT_LIBLLVM_PATH"):
        assert module.best_variant() == "scalar_rgb"


def test_the_plugins_are_there_again_after_a_change_of_variant_which_must_have_rgb(use):
    mi = use("scalar_rgb")
    other = next(name for name in mi.variants() if name not in ("scalar_rgb", "llvm_ad_rgb") and "scalar" in name)
    mi.set_variant(other)
    mi.set_variant("scalar_rgb")
    assert "twillight[" in str(mi.load_dict({"type": "twillight", "fabric": "denim"}))
    assert "twillight_path[" in str(mi.load_dict({"type": "twillight_path"}))
    mi.set_variant(next(name for name in mi.variants() if name.startswith("scalar_spectral")))
    assert "must have RGB colours" in refusal(module.register)
    with pytest.raises(RuntimeError, match="must have RGB colours"):
        mi.load_dict({"type": "twillight", "fabric": "denim"})
