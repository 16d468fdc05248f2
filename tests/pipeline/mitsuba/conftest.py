"""Variants of Mitsuba: the scalar one works everywhere, the other one needs LLVM."""

import math

import numpy as np
import pytest

from pipeline.mitsuba.register import register
from pipeline.scenes.variant import llvm_works, mitsuba

NEEDS_LLVM = pytest.mark.skipif(not llvm_works(), reason="no LLVM that Mitsuba can use")


def unit(degrees, azimuth):
    """Return a direction, from its angle to the normal and its azimuth in degrees."""
    theta, phi = math.radians(degrees), math.radians(azimuth)
    return np.array([math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)])


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
    """Return Mitsuba with the plugins, in each variant."""
    return use(request.param)


@pytest.fixture
def llvm(use):
    """Return Mitsuba in the vectorised variant; its tests have the mark NEEDS_LLVM."""
    return use("llvm_ad_rgb")


@pytest.fixture
def scalar(use):
    """Return Mitsuba in the scalar variant."""
    return use("scalar_rgb")
