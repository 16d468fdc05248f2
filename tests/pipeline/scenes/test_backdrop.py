"""What is seen beside and behind cloth, against closed forms of a matte floor."""

import math

import numpy as np
import pytest

from pipeline.scenes.frame import render
from pipeline.scenes.loading import load
from pipeline.scenes.options import SceneOptions
from pipeline.scenes.scene import Scene


def build(mi):
    """Return a floor of albedo (.2, .4, .6), a cloth above it, and a slanting sun, seen from straight above."""
    move = mi.ScalarTransform4f
    matte = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.2, 0.4, 0.6]}}
    look = move().look_at([0, 0, 5], [0, 0, 0], [0, 1, 0])
    return {
        "type": "scene",
        "floor": {"type": "rectangle", "to_world": move().scale(1.5), "matte": matte},
        "cloth": {
            "type": "rectangle",
            "to_world": move().translate([0, 0, 0.5]).scale(0.5),
            "wears": {"type": "diffuse", "id": "fabric_voile"},
        },
        "sun": {"type": "directional", "direction": [-1, 0, -1], "irradiance": 2.0},
        "sky": {"type": "constant", "radiance": 0.0},
        "camera": {
            "type": "orthographic",
            "to_world": look @ move().scale([2, 2, 1]),
            "film": {"type": "hdrfilm", "width": 80, "height": 80},
        },
    }


def test_a_matte_floor_and_the_shadow_of_the_cloth_on_it():
    """albedo / pi times 2 cos 45; the shadow lies 1/2 to the left of the cloth and is not seen behind it."""
    frame = render(load(Scene(name="a", source=build), SceneOptions(variant="scalar_rgb")))
    x = (np.arange(80) + 0.5) / 20 - 2
    x, y = np.meshgrid(x, -x)
    lit = np.array([0.2, 0.4, 0.6]) * 2 * math.cos(math.pi / 4) / math.pi
    cloth = (np.abs(x) < 0.5) & (np.abs(y) < 0.5)
    assert (frame.gbuffers["voile"].mask == cloth).all()
    floor = (np.abs(x) < 1.5) & (np.abs(y) < 1.5)
    shadow = (np.abs(x + 0.5) < 0.5) & (np.abs(y) < 0.5) & ~cloth
    assert shadow.sum() == 200
    assert frame.backdrop[shadow] == pytest.approx(0.0)
    assert frame.backdrop[~floor] == pytest.approx(0.0)
    assert frame.backdrop[floor & ~shadow] == pytest.approx(
        np.broadcast_to(lit, ((floor & ~shadow).sum(), 3)), rel=1e-5
    )
