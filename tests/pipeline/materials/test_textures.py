import math

import numpy as np
import pytest

from pipeline.materials.lobes import reflectance, white_f0
from pipeline.materials.planes import layout, planes
from pipeline.materials.textures import across_direction, constants, gltf_strength, openpbr_roughness, textures
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from pipeline.truth.scattering.thread_colours import component_colours
from tests.presets import slow
from weaves.fabric import load_fabric, preset_names
from weaves.surface import GAP, surface_at


def maps_of(fabric, size, halvings=0):
    share = reflectance(fabric)
    level = planes(fabric, layout(fabric, size), share)
    for _ in range(halvings):
        level = level.halved()
    return textures(level, constants(fabric, share))


def diffuse_albedo(fabric, side, sky=1.0):
    """Return the truth's diffuse share of an even sky's light above (1) or behind (-1), by a grid of directions."""
    square, turn = (np.stack(np.meshgrid(*[(np.arange(side) + 0.5) / side] * 2), -1).reshape(-1, 2)).T
    z, sine, turn = np.sqrt(square), np.sqrt(1.0 - square), 2.0 * math.pi * turn
    wi = np.stack([sine * np.cos(turn), sine * np.sin(turn), sky * z], axis=-1)
    none, size = np.zeros(len(wi)), np.full(len(wi), 2.0 * max(fabric.repeat))
    queries = Queries.round(none, none, size, wi, np.tile([0.0, 0.0, 1.0], (len(wi), 1)))
    options = TruthOptions(estimator="mc", relative_error=0.04)
    mean = estimate(fabric, queries, options, seed=11).mean
    colours = component_colours(fabric, queries, options, seed=12).mean
    return np.pi * (mean[:, 2:, None] * colours[:, 2:] / z[:, None, None]).sum(axis=1).mean(axis=0)


@pytest.mark.parametrize(("name", "side"), [("denim", 16), ("gauze", 16), *(slow(name, 24) for name in preset_names())])
def test_the_mean_base_colour_is_the_diffuse_albedo_of_the_truth(name, side):
    fabric = load_fabric(name)
    maps = maps_of(fabric, 1024 if name == "tartan" else 256)
    found = (maps.base_color * maps.opacity[..., None]).mean(axis=(0, 1))
    np.testing.assert_allclose(found, diffuse_albedo(fabric, side), rtol=0.03)


def test_the_mean_transmitted_colour_the_fibres_direction_and_roughness_are_those_of_the_truth():
    fabric = load_fabric("gauze")
    maps = maps_of(fabric, 256)
    through = (maps.transmission_color * maps.opacity[..., None]).mean(axis=(0, 1))
    np.testing.assert_allclose(through, diffuse_albedo(fabric, 16, sky=-1.0), rtol=0.03)
    maps = maps_of(load_fabric("denim"), 64)
    flat = across_direction(maps.normal, maps.tangent)
    laid = np.concatenate([flat, np.zeros_like(flat[..., :1])], axis=-1)
    laid -= maps.normal * (laid * maps.normal).sum(axis=-1, keepdims=True)
    laid /= np.linalg.norm(laid, axis=-1, keepdims=True)
    assert np.abs((laid * maps.tangent).sum(axis=-1)).max() < 1e-3
    fabric = load_fabric("silk_charmeuse")
    maps = maps_of(fabric, 512)
    alphas = np.float32([fabric.warp.roughness, fabric.weft.roughness])
    # Texels between yarns hold several fibres.
    nearest = np.abs(maps.alpha_along[..., None] - alphas).min(axis=-1)
    assert (nearest < 0.01).mean() > 0.9
    assert maps.alpha_across.min() > 0.9


@pytest.mark.parametrize(("name", "size", "halvings"), [("denim", 256, 4), slow("satin_8", 256, 4), ("gauze", 512, 5)])
def test_roughness_of_mip_levels_holds_the_variance_below_a_texel(name, size, halvings):
    """The squared projected area of flakes, alpha^2 + (1 - alpha^2) |w x t|^2, averaged over points of a texel."""
    fabric = load_fabric(name)
    found, maps = layout(fabric, size), maps_of(fabric, size, halvings)
    rows, columns = maps.opacity.shape
    points = (np.arange(64) + 0.5) / 64
    for row, column in [(1, 2), (5, 5), (rows - 2, 3), (4, columns - 1)]:
        x = (column + points) * found.ends / columns
        y = (row + points) * found.picks / rows
        surface = surface_at(fabric, x[None, :], y[:, None])
        solid = surface.yarn != GAP
        t, n = surface.tangent[solid], surface.normal[solid]
        alpha = np.array([fabric.warp.roughness, fabric.weft.roughness])[surface.yarn[solid]]

        def square_area(w, t=t, alpha=alpha):
            across = (np.cross(w, t) ** 2).sum(axis=-1)
            return float((across + alpha**2 * (t @ w) ** 2).mean())

        mean = n.mean(axis=0)
        mean /= np.linalg.norm(mean)
        np.testing.assert_allclose(maps.normal[row, column], mean, atol=0.02)
        normal, along = maps.normal[row, column].astype(float), maps.tangent[row, column].astype(float)
        across = np.cross(normal, along)
        upright = square_area(normal)
        assert maps.alpha_along[row, column] ** 2 == pytest.approx(square_area(along) / upright, rel=0.03)
        expected = min(1.0, square_area(across) / upright)
        assert maps.alpha_across[row, column] ** 2 == pytest.approx(expected, rel=0.03)
        # The variance only adds: no texel is smoother than its smoothest fibre.
        assert maps.alpha_along[row, column] >= 0.99 * alpha.min()
        # No other direction in the surface is smoother.
        for turn in np.linspace(0.0, math.pi, 7):
            other = math.cos(turn) * along + math.sin(turn) * across
            assert square_area(other) >= 0.97 * square_area(along)


def test_openpbr_and_gltf_give_both_alphas_the_specular_colour_and_the_index_of_refraction_back():
    along, across = np.float32([0.1, 0.5, 0.7]), np.float32([1.0, 0.9, 0.7])
    r, a = openpbr_roughness(along, across)
    rough = r**2 * np.sqrt(2.0 / (1.0 + (1.0 - a) ** 2))
    np.testing.assert_allclose(rough, across, rtol=1e-5)
    np.testing.assert_allclose((1.0 - a) * rough, along, rtol=1e-5)
    s = gltf_strength(along, across)
    np.testing.assert_allclose(along + (1.0 - along) * s**2, across, rtol=1e-5)
    fabric = load_fabric("satin_8")
    share, maps = reflectance(fabric), maps_of(fabric, 256)
    material = constants(fabric, share)
    f0 = ((material.ior - 1.0) / (material.ior + 1.0)) ** 2
    found = f0 * maps.specular_color.mean(axis=(0, 1))
    colours = [thread.specular[0] for thread in fabric.thread_colours()]
    np.testing.assert_allclose(found, (share.coverage * white_f0(fabric, share)) @ np.array(colours), rtol=0.02)
