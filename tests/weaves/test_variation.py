import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from weaves.fabric import load_fabric
from weaves.variation import PATCH, Variation

REPEAT = (4, 3)


@given(st.floats(0, 0.3), st.floats(0, 0.2), st.integers(0, 2**32 - 1))
def test_a_patch_tiles_and_folds_nowhere(spacing, skew, seed):
    variation, sides = Variation(spacing=spacing, skew=skew, seed=seed), PATCH * np.array(REPEAT)
    place = np.random.default_rng(seed).uniform(-300.0, 600.0, (50, 2))
    shown, jacobian = variation.lattice(REPEAT, place)
    assert (np.linalg.det(jacobian) > 0.0).all()
    np.testing.assert_allclose(variation.lattice(REPEAT, place + sides)[0], shown + sides, atol=1e-8)


def test_the_derivative_is_that_of_the_places():
    variation, place = Variation(spacing=0.1, skew=0.1), np.random.default_rng(1).uniform(0.0, 200.0, (200, 2))
    _, jacobian = variation.lattice(REPEAT, place)
    for axis, step in enumerate(1e-6 * np.eye(2)):
        ahead, back = (variation.lattice(REPEAT, place + sign * step)[0] for sign in (1.0, -1.0))
        np.testing.assert_allclose((ahead - back) / 2e-6, jacobian[:, :, axis], atol=1e-6)


def test_spacings_and_slopes_have_the_stated_deviations_and_the_mean_of_the_lattice():
    """Over 40 seeds; the standard error of a deviation of n independent values is its share 1 / sqrt(2 n)."""
    spacings, slopes = [], []
    for seed in range(40):
        variation = Variation(spacing=0.08, skew=0.05, seed=seed)
        borders = variation._borders(0, REPEAT[0])
        spacings.append(np.diff(borders))
        assert borders[0] == 0.0 and borders[-1] == pytest.approx(PATCH * REPEAT[0])
        slopes.append(variation._wave(0, REPEAT[1], np.arange(0.0, PATCH * REPEAT[1], 0.5))[1])
    assert np.std(spacings) == pytest.approx(0.08, rel=4.0 / math.sqrt(2 * 40 * 256))
    # Over a whole period the square of a wave is 1/2 whatever its phase.
    assert np.sqrt(np.mean(np.square(slopes))) == pytest.approx(0.05, rel=1e-6)


@pytest.mark.parametrize("name", ["denim", "tartan"])
def test_threads_have_shades_of_their_own_colours(name):
    fabric = load_fabric(name)
    assert fabric.in_shades() is fabric
    shaded = fabric.model_copy(update={"variation": Variation(colour=0.2)}).in_shades()
    assert shaded.optics() == fabric.optics()
    for own, threads in zip(fabric.thread_colours(), shaded.thread_colours(), strict=True):
        light = threads.diffuse / np.resize(own.diffuse, threads.diffuse.shape)
        np.testing.assert_allclose(light.min(axis=1), light.max(axis=1), rtol=1e-12)
        shades = -np.log(light[:, 0]) / 0.2
        # |g| of a normal g, rounded down to 3/8 of a deviation: the mean is .80 less about half a shade.
        assert shades.min() == 0.0 and shades.mean() == pytest.approx(0.63, abs=0.15) and shades.max() < 3.0
