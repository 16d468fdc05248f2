"""Variants of Mitsuba, of which the scalar one works everywhere and the other one needs LLVM; worn cloth."""

import numpy as np
import pytest

from pipeline.mitsuba.register import register
from pipeline.mitsuba.worn import ClothOptions, RayHits, Worn
from pipeline.scenes.variant import llvm_works, mitsuba

NEEDS_LLVM = pytest.mark.skipif(not llvm_works(), reason="no LLVM that Mitsuba can use")


CONFIGURATIONS = {
    "front": ("polyester_lining", 0.3, 30.0, 20.0),
    "along the normal": ("denim", 0.3, 0.0, 0.0),
    "grazing": ("silk_charmeuse", 0.4, 80.0, 130.0),
    "very grazing": ("wool_gabardine", 0.4, 86.0, 250.0),
    "wide": ("silk_charmeuse", 30.0, 40.0, 65.0),
    "tiny": ("polyester_lining", 0.001, 50.0, 250.0),
    "one yarn": ("cotton_twill", 0.1, 60.0, 300.0),
    "voile": ("voile", 1.5, 20.0, 100.0),
    "gauze": ("gauze", 0.4, 70.0, 10.0),
    "behind": ("silk_charmeuse", 0.5, 130.0, 45.0),
    "behind a gauze": ("gauze", 1.0, 105.0, 200.0),
    "behind, along the normal": ("denim", 0.5, 180.0, 0.0),
}
"""Fabric, deviation of the footprint, and the viewer's angle to the normal and azimuth: more than 90 is behind."""

UV = (0.0062, 0.0057)


def hits_of(viewer, count=1, uv=UV, **other):
    """Return places of a shape that face the viewer."""
    one = {"uv": uv, "viewer": viewer, "outward": [0.0, 0.0, 1.0], "handed": 1.0, "stride": [1.0, 0.0]}
    one |= {"jacobian": np.zeros((2, 2)), "spread": 0.0, "bend": 0.0}
    return RayHits(**{name: np.repeat([value], count, axis=0) for name, value in one.items()} | other)


def worn_of(fabric, sigma=0.3, **other):
    return Worn(ClothOptions(fabric=fabric, sigma=sigma, **other))


@pytest.fixture
def use():
    """Return a function that sets a variant and returns Mitsuba; the one before is set again afterwards."""
    import mitsuba as mi

    before = mi.variant()

    def chosen(variant):
        mitsuba(variant)
        return register()

    yield chosen
    if before is not None:
        mi.set_variant(before)


@pytest.fixture(params=["scalar_rgb", pytest.param("llvm_ad_rgb", marks=[NEEDS_LLVM, pytest.mark.external])])
def mi(request, use):
    return use(request.param)


@pytest.fixture
def llvm(use):
    return use("llvm_ad_rgb")


@pytest.fixture
def scalar(use):
    return use("scalar_rgb")
