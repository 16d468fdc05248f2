import math

import numpy as np
import pytest
from scipy import stats

from pipeline.truth.footprint.place import BOX, BOX_SIDE, GAUSSIAN, Axis, place


def test_moments_of_the_wrapped_kernel_and_a_box_of_whole_repeats_is_the_repeat_average():
    for shape in [GAUSSIAN, BOX]:
        for sigma in [0.05, 0.4, 0.899, 0.901, 1.4, 2.9, 3.1, 40.0]:
            # The k-th circular moment of a wrapped kernel is that of the kernel itself: exp(-w^2 s^2 / 2), or a sinc.
            repeat, centre, numbers = 3.0, 1.2, (np.arange(20_000) + 0.5) / 20_000
            x, weight = np.array([place(Axis(shape, centre, sigma, repeat), n) for n in numbers]).T
            assert ((x >= 0) & (x < repeat)).all()
            for k in range(4):
                w = 2 * np.pi * k / repeat
                gaussian, box = np.exp(-0.5 * (w * sigma) ** 2), np.sinc(w * sigma * BOX_SIDE / (2 * np.pi))
                expected = (gaussian if shape == GAUSSIAN else box) * np.exp(1j * w * centre)
                assert abs(np.mean(weight * np.exp(1j * w * x)) - expected) < 2e-4
    assert stats.uniform(0, BOX_SIDE).std() == pytest.approx(1.0) and math.isclose(BOX_SIDE, math.sqrt(12))
    for whole in (1, 2, 7):
        sigma = 2.0 * whole / BOX_SIDE
        weights = [place(Axis(BOX, 0.3, sigma, 2.0), (k + 0.5) / 64)[1] for k in range(64)]
        np.testing.assert_allclose(weights, 1.0, rtol=1e-12)
