import numpy as np
import pytest
from scipy import special

from pipeline.compiled.float32 import absorbed, arcsine, remaining
from pipeline.compiled.normal import normal_distribution, normal_quantile

DEPTHS = np.logspace(-30, 1.9, 4000).astype(np.float32)
SHARES = np.concatenate([np.logspace(-16, -1, 300), np.linspace(0.01, 0.99, 500), 1 - np.logspace(-10, -2, 100)])
SINES, NUMBERS = np.linspace(-1, 1, 2001).astype(np.float32), np.linspace(-6, 6, 2001).astype(np.float32)


@pytest.mark.parametrize(
    ("kernel", "exact", "arguments", "rtol", "atol"),
    [
        (absorbed, lambda x: -special.expm1(-x), DEPTHS, 6e-7, 0.0),
        (remaining, lambda x: np.exp(-x), DEPTHS[DEPTHS < 60], 3e-5, 0.0),
        (arcsine, np.arcsin, SINES, 0.0, 7e-5),
        (normal_quantile, special.ndtri, SHARES, 2e-9, 1e-12),
        (normal_distribution, special.ndtr, NUMBERS, 0.0, 4e-7),
    ],
)
def test_kernels_have_the_digits_of_double_precision(kernel, exact, arguments, rtol, atol):
    ours = [kernel(x) for x in arguments]
    np.testing.assert_allclose(ours, exact(arguments.astype(np.float64)), rtol=rtol, atol=atol)


def test_absorbed_and_remaining_at_their_ends():
    assert absorbed(np.float32(0.0)) == 0.0 and remaining(np.float32(0.0)) == pytest.approx(1.0, rel=3e-5)
    assert all(remaining(x) >= 0 for x in DEPTHS) and remaining(np.float32(1e30)) < 1e-30
