"""Weights of fixed nodes: products against the Gaussian itself, waves against products."""

import numpy as np
import pytest

from pipeline.analytic.soft_nodes.nodes import tabulate
from pipeline.analytic.soft_nodes.scratch import SoftQuery, scratch_for
from pipeline.analytic.soft_nodes.wide import axis_densities, product_weights, wave_weights, waves_kept
from pipeline.truth.footprint.mixture import narrow_axis
from tests.presets import slow
from weaves.fabric import load_fabric


def by_products(table, x, y, deviation_x, deviation_y, correlation=0.0):
    """Return the weights by products; those of an ellipse at an angle from 401 points of its line."""
    scratch = scratch_for(table, 1)
    blur, line = np.sqrt(1.0 - abs(correlation)), np.sqrt(abs(correlation))
    places = np.linspace(-4.0, 4.0, 401) if correlation else np.zeros(1)
    shares = np.exp(-0.5 * places**2) / np.exp(-0.5 * places**2).sum()
    deviation_x, deviation_y, shift_x, shift_y = (
        blur * deviation_x, blur * deviation_y, line * deviation_x, np.sign(correlation) * line * deviation_y,
    )  # fmt: skip
    of_x = table.places_x, table.weights_x, scratch.density_x, scratch.touched_x, scratch.columns
    of_y = table.places_y, table.weights_y, scratch.density_y, scratch.touched_y, scratch.rows
    for place, share in zip(places, shares, strict=True):
        columns, rows = (
            axis_densities(*rules, np.float32(centre), np.float32(deviation), *written)
            for (*rules, density, touched, found), centre, deviation in (
                (of_x, x + place * shift_x, deviation_x),
                (of_y, y + place * shift_y, deviation_y),
            )
            for written in [(density, touched, found)]
        )
        product_weights(table, scratch, columns, rows, np.float32(share))
    return scratch.weight / (2.0 * np.pi * deviation_x * deviation_y)


def by_waves(table, x, y, deviation_x, deviation_y, correlation=0.0):
    scratch = scratch_for(table, 1)
    narrowest = np.float32(narrow_axis(deviation_x, deviation_y, correlation))
    footprint = (np.float32(n) for n in (deviation_x, deviation_y, correlation))
    above, turn = (np.float32(n) for n in (0, 0, 1, 0, 0, 1)), np.float32(0)
    look = SoftQuery(float(x), float(y), *footprint, narrowest, *above, 0, 1, turn, 0, 1, turn, turn, turn)
    wave_weights(table, scratch, look, waves_kept(table.wave_size, narrowest))
    return scratch.weight


@pytest.mark.parametrize("name", ["denim", slow("satin_8"), slow("herringbone")])
@pytest.mark.parametrize("correlation", [slow(0.0), -0.4, 0.8])
@pytest.mark.parametrize("stretch", [1.0, 1.7])
def test_waves_are_the_gaussian_over_all_images(name, stretch, correlation):
    """To a tenth of the largest: several waves of 1 % are missing, and tails of up to 3.4 % of the peak are cut off."""
    table = tabulate(load_fabric(name))
    narrow = max(table.waves_from, 0.3)
    for x, y, deviation in ((0.3, 0.7, narrow), (2.9, 1.2, 1.3 * narrow)):
        deviation /= narrow_axis(1.0, stretch, correlation)
        asked = (table, x, y, deviation, stretch * deviation, correlation)
        waves, products = (of(*asked) for of in (by_waves, by_products))
        assert np.abs(waves - products).max() < 0.1 * table.evenly.max()
        if correlation == 0.0:
            assert np.abs(waves - table.evenly).max() > 0.2 * table.evenly.max()  # far from even: the test can fail
        assert waves.sum() == pytest.approx(1.0, abs=0.03)
        assert products.sum() == pytest.approx(1.0, abs=0.03)


def test_from_uniform_on_the_cloth_is_covered_evenly():
    table = tabulate(load_fabric("cotton_twill"))
    assert table.evenly.sum() == pytest.approx(1.0, abs=1e-5)
    weights = by_waves(table, 0.4, 1.7, table.uniform, table.uniform)
    np.testing.assert_allclose(weights, table.evenly, atol=0.07 * table.evenly.max())
