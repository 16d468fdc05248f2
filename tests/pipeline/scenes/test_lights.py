import math

import numpy as np
import pytest

from pipeline.scenes.lights import fibonacci, lights_of
from pipeline.scenes.options import SceneOptions
from pipeline.scenes.variant import mitsuba


@pytest.mark.parametrize("count", [16, 64, 1000])
def test_the_lattice_integrates_low_harmonics(count):
    """Means of d and of d d^T are 0 and 1/3 on the sphere; the lattice's error falls faster than 1/count."""
    towards = fibonacci(count)
    assert np.linalg.norm(towards, axis=1) == pytest.approx(1.0)
    assert np.abs(towards.mean(axis=0)).max() < 2 / count
    assert np.abs(towards.T @ towards / count - np.eye(3) / 3).max() < 2 / count


def test_an_environment_map_keeps_its_light_and_a_lamp_at_the_origin_is_read():
    """L = 2 + cos(angle to its up axis y): irradiances sum to 8 pi, their vectors to 4 pi / 3 along y. 1 % for a map of
    32 by 64 texels; 4 % for the vectors, which 64 directions round to their cells' centres."""
    mi = mitsuba("scalar_rgb")
    cosine = np.cos((np.arange(32) + 0.5) / 32 * math.pi)
    texels = np.repeat(np.repeat((2 + cosine)[:, None, None], 64, axis=1), 3, axis=2).astype(np.float32)
    sky = {"type": "envmap", "bitmap": mi.Bitmap(texels)}
    world = mi.load_dict({"type": "scene", "ball": {"type": "sphere"}, "sky": sky})
    lights = lights_of(mi, world, "test", SceneOptions(environment_directions=64))
    assert len(lights) == 64 and all(light.distant for light in lights)
    assert sum(light.power for light in lights) == pytest.approx(np.full(3, 8 * math.pi), rel=0.01)
    vector = sum(light.power[0] * light.place for light in lights)
    assert vector == pytest.approx([0, 4 * math.pi / 3, 0], abs=0.04 * 4 * math.pi / 3)
    for place in ([0, 0, 0], [0, 3, 4]):
        lamp = {"type": "point", "position": place, "intensity": {"type": "rgb", "value": [1, 2, 3]}}
        world = mi.load_dict({"type": "scene", "ball": {"type": "sphere"}, "lamp": lamp})
        (light,) = lights_of(mi, world, "test", SceneOptions())
        assert not light.distant
        assert light.place == pytest.approx(place) and light.power == pytest.approx([1, 2, 3])
        assert light.reach(np.array([[6.0, 3, 4]]))[1] == pytest.approx(np.linalg.norm(np.subtract([6, 3, 4], place)))
