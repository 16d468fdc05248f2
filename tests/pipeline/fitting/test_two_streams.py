"""Two streams by their closed forms, and by the addition of layers."""

import pytest

from pipeline.fitting.two_streams import layer, scattering_of, transmittance_of


@pytest.mark.parametrize("scattering", [0.3, 2.0, 8.0])
def test_a_layer_that_absorbs_nothing_has_its_closed_form(scattering):
    assert layer(1.0, scattering) == pytest.approx((scattering / (1 + scattering), 1 / (1 + scattering)), rel=1e-4)


@pytest.mark.parametrize("a", [1.001, 1.2, 6.0])
def test_two_layers_are_one_of_both(a):
    """Stokes: T = T1 T2 / (1 - R1 R2), R = R1 + T1^2 R2 / (1 - R1 R2)."""
    (r1, t1), (r2, t2) = layer(a, 0.7), layer(a, 1.9)
    between = 1.0 - r1 * r2
    assert layer(a, 2.6) == pytest.approx((r1 + t1 * t1 * r2 / between, t1 * t2 / between))


@pytest.mark.parametrize(("reflectance", "transmittance"), [(0.845, 0.122), (0.3, 0.5), (0.05, 1e-4)])
def test_a_layer_is_found_again(reflectance, transmittance):
    scattering = scattering_of(reflectance, transmittance)
    assert transmittance_of(reflectance, scattering) == pytest.approx(transmittance, rel=1e-3)


def test_yarns_reflect_at_most_what_white_ones_do():
    assert transmittance_of(0.99, 2.0) == pytest.approx(1.0 / 3.0, rel=1e-4) and transmittance_of(1e-4, 500.0) == 0.0
