import math

import numpy as np
import pytest

from tests.presets import slow
from tests.refusals import refusal
from weaves.fabric import Fabric, load_fabric
from weaves.validation import validated
from weaves.yarn import Yarn

denim = load_fabric("denim")
RADIUS, WEIGHT = np.polynomial.legendre.leggauss(48)


def scattered_once(alpha, thickness, cosine, turn):
    """Return what goes straight through a layer of white flakes towards wo, and what it scatters once.

    wo has a cosine to the normal z and an azimuth to the fibres along x. The half vectors are those that wo sees: a
    sphere's, cosine-distributed, stretched as the flakes are; Gauss points in the squared radius, even ones around.
    """
    sine = math.sqrt(1.0 - cosine * cosine)
    wo = np.array([sine * math.cos(turn), sine * math.sin(turn), cosine])
    stretch = np.array([alpha, 1.0, 1.0])
    axis = wo * stretch
    sigma_o = np.linalg.norm(axis)
    axis /= sigma_o
    side = np.cross(axis, [0.0, 0.0, 1.0] if abs(axis[2]) < 0.9 else [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    square, around = (RADIUS[:, None] + 1.0) / 2.0, 2.0 * math.pi * (np.arange(192) + 0.5) / 192
    radius = np.sqrt(square)
    places = [radius * np.cos(around), radius * np.sin(around), np.sqrt(1.0 - square) + 0.0 * around]
    half = sum(part[..., None] * base for part, base in zip(places, (side, np.cross(axis, side), axis), strict=True))
    half = half * stretch
    half /= np.linalg.norm(half, axis=-1, keepdims=True)
    wi = 2.0 * (half @ wo)[..., None] * half - wo
    lambda_i = np.linalg.norm(wi * stretch, axis=-1) / np.maximum(np.abs(wi[..., 2]), 1e-12)
    lambda_o = sigma_o / cosine
    # A photon on its way from wo meets its flake at a depth z: exp(-lambda_o z), and then leaves by either side.
    both, apart = lambda_o + lambda_i, lambda_o - lambda_i
    apart = np.where(np.abs(apart) < 1e-9, 1e-9, apart)
    back = lambda_o * -np.expm1(-thickness * both) / both
    on = lambda_o * (np.exp(-thickness * lambda_i) - np.exp(-thickness * lambda_o)) / apart
    shares = np.where(wi[..., 2] > 0.0, back, on)
    return math.exp(-thickness * lambda_o), float((WEIGHT / 2.0) @ shares.mean(axis=1))


COARSE = ((0.01, 0.3, 1.0), (0.001, 0.1, 0.46, 1.2, 2.0, 10.0), (1.0, 0.6, 0.1, 1e-5), (0.0, 1.0, math.pi / 2))
FINE = (
    (0.01, 0.03, 0.1, 0.3, 0.6, 1.0), np.geomspace(1e-3, 100.0, 40), (1.0, 0.97, 0.85, 0.6, 0.3, 0.1, 0.01, 1e-3, 1e-6),
    np.linspace(0.0, math.pi / 2, 5),
)  # fmt: skip


@pytest.mark.parametrize("grid", [COARSE, slow(FINE)], ids=["coarse", "fine"])
def test_all_light_that_a_point_sends_out_is_at_most_what_it_receives_and_the_limit_is_near(grid):
    roughness, thicknesses, cosines, turns = grid
    for thickness in thicknesses:
        largest = dict.fromkeys((0.0, 0.5, 1.0), 0.0)
        for alpha in roughness:
            for straight, once in (scattered_once(alpha, thickness, c, turn) for c in cosines for turn in turns):
                assert straight + once <= 1.0 + 1e-6
                for specular in largest:
                    yarn = Yarn(bend=0.0, roughness=alpha, specular=(specular,) * 3)
                    most = yarn.most_diffuse(thickness)[0]
                    largest[specular] = max(largest[specular], straight + specular * once + most)
        assert max(largest.values()) <= 1.0 + 1e-6, thickness
        # It is exact for black flakes; for white ones .05 is left, for grey ones a chord adds as much.
        assert largest[0.0] == pytest.approx(1.0, abs=1e-9) and largest[1.0] > 0.95 and largest[0.5] > 0.9, thickness


def read(yarn=(), **table):
    return validated(Fabric, denim.model_dump() | {"warp": denim.warp.model_dump() | dict(yarn)} | table, "cloth.toml")


def test_a_yarn_at_the_limit_is_legal_and_a_thread_keeps_as_much_light_as_its_colour_leaves():
    most = Yarn(bend=0.0, roughness=0.5, specular=(0.2, 0.9, 1.0)).most_diffuse(2.0)
    assert 1.0 > most[0] > most[1] > most[2] > 0.4
    given = {"specular": (0.2, 0.9, 1.0), "diffuse": most}
    assert read(given).warp.diffuse == most
    sentence = refusal(read, given | {"diffuse": (*most[:2], most[2] + 0.001)})
    for part in ("cloth.toml: warp.diffuse = (", "specular 1 and optical_thickness 2", "at most 0.4497 in blue"):
        assert part in sentence
    palette = {"pale": {"diffuse": [0.7, 0.5, 0.1]}}
    cloth = read({"diffuse": (0.1,) * 3, "diffuse_transmission": (0.3,) * 3}, colours={
        "palette": palette, "ends": [["pale", 1]]})  # fmt: skip
    most = np.array(cloth.warp.most_diffuse(2.0))
    through = cloth.thread_colours()[0].diffuse_transmission[0]
    np.testing.assert_allclose(through, np.minimum(0.3, most - palette["pale"]["diffuse"]))


@pytest.mark.parametrize(
    ("yarn", "table", "named"),
    [
        ({"specular": (1.0,) * 3, "diffuse": (1.0,) * 3}, {}, "warp.diffuse = (1.0, 1.0, 1.0): with specular 1"),
        ({"diffuse_transmission": "#ffffff"}, {}, "diffuse + diffuse_transmission may be at most"),
        ({}, {"optical_thickness": 0.001}, "optical_thickness 0.001, it may be at most 0.0009 in red"),
        ({}, {"colours": {"palette": {"snow": {"diffuse": "#ffffff"}}, "picks": [["snow", 1]]}},
         "colours.palette.snow.diffuse = '#ffffff': on picks with specular 0.12"),
    ],
)  # fmt: skip
def test_what_makes_light_is_refused(yarn, table, named):
    assert named in refusal(read, yarn, **table)
