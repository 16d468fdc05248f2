import numpy as np
import pytest

from pipeline.materials.lobes import charlie, even_sky, ggx, ggx_density
from pipeline.truth.scattering.slab import density


@pytest.mark.parametrize("alpha", [0.1, 0.3, 0.8])
def test_ggx_of_a_fibre_has_the_density_of_its_flakes(alpha):
    half = even_sky(32)
    flakes = [density(*h, 1.0, 0.0, 0.0, alpha) for h in half]
    np.testing.assert_allclose(ggx_density(half, alpha, 1.0), flakes, rtol=1e-10)


@pytest.mark.parametrize(("along", "across"), [(0.3, 1.0), (0.5, 0.5)])
def test_the_projected_area_of_the_facets_is_that_of_the_surface(along, across):
    # Directions drawn by the cosine: the mean of pi D is the integral of D cos.
    assert np.pi * ggx_density(even_sky(1 << 16), along, across).mean() == pytest.approx(1.0, rel=0.01)


@pytest.mark.parametrize("angle", [0.0, 45.0, 75.0])
def test_no_lobe_returns_more_light_than_it_receives(angle):
    wi, wo = even_sky(1 << 14), np.array([np.sin(np.radians(angle)), 0.0, np.cos(np.radians(angle))])
    for along, across in ((0.2, 1.0), (1.0, 1.0)):
        share = np.pi * ggx(wi, wo, along, across, np.ones(3)).mean(axis=0)
        assert (share > 0.3).all() and (share < 1.0).all()
    assert 0.0 < np.pi * charlie(wi, wo).mean() < 1.0


def test_lobes_are_reciprocal():
    a, b = np.array([0.6, 0.0, 0.8]), np.array([0.0, 0.28, 0.96])
    there, back = ggx(a[None], b, 0.2, 1.0, np.full(3, 0.1)), ggx(b[None], a, 0.2, 1.0, np.full(3, 0.1))
    np.testing.assert_allclose(there, back, rtol=1e-12)
    np.testing.assert_allclose(charlie(a[None], b), charlie(b[None], a), rtol=1e-12)
