import numpy as np
import pytest

from pipeline.scenes.shade import colours, shade
from pipeline.truth.query import Queries
from weaves.fabric import Fabric, load_fabric


def lit(side):
    """Return queries that are lit from these sides."""
    ones, none = np.ones_like(side), np.zeros_like(side)
    wi, wo = np.stack([0.6 * ones, none, 0.8 * side], axis=-1), np.stack([none, none, ones], axis=-1)
    return Queries.round(ones, ones, ones, wi, wo)


def test_shade_applies_each_colour_to_its_component():
    """One component at a time gives back its own colour, transmitted light that of transmission."""
    denim = load_fabric("denim")
    fabric = denim.model_copy(update={"weft": denim.weft.model_copy(update={"diffuse_transmission": (0.1, 0.2, 0.3)})})
    yarns, sides = (fabric.warp, fabric.weft), ("diffuse_rgb", "diffuse_transmission_rgb")
    expected = [[getattr(yarn, name) for name in ("specular_rgb", side) for yarn in yarns] for side in sides]
    rgb = shade(fabric, np.tile(np.eye(4), (2, 1)), lit(np.repeat([1.0, -1.0], 4)))
    assert rgb.reshape(2, 4, 3) == pytest.approx(np.array(expected))
    assert np.array([colours(fabric), colours(fabric, transmitted=True)]) == pytest.approx(np.array(expected))
    assert fabric.warp.diffuse_rgb != fabric.weft.diffuse_rgb


def test_footprints_of_a_check_take_the_colours_of_their_own_threads():
    """A white end beside a black one: each footprint on one end has its colour, a wide one the mean of both."""
    palette = {"white": {"diffuse": [1.0, 1.0, 1.0]}, "black": {"diffuse": [0.0, 0.0, 0.0]}}
    order = {"palette": palette, "ends": [["white", 2], ["black", 2]]}
    fabric = Fabric.model_validate(load_fabric("denim").model_dump() | {"colours": order})
    places = np.array([1.0, 3.0, 5.0, 2.0])
    size = np.array([0.1, 0.1, 0.1, 50.0])
    queries = lit(np.ones(4))._replace(u=places, sigma=size, sigma_minor=size)
    rgb = shade(fabric, np.tile([0.0, 0.0, 1.0, 0.0], (4, 1)), queries)
    assert rgb[:, 0] == pytest.approx([1.0, 0.0, 1.0, 0.5], abs=1e-3)
    assert colours(fabric)[2] == pytest.approx([0.5] * 3)
