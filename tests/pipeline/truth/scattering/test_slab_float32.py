import numpy as np
import pytest

from pipeline.truth.scattering import slab, slab_float32

COUNT = 2000


def drawn(seed):
    """Return density, both sigma, both cosines and thickness: thin layers, thick layers and grazing angles."""
    random = np.random.default_rng(seed)
    density = 10.0 ** random.uniform(-4, 2, COUNT)
    sigma_i, sigma_o = random.uniform(0.01, 1.0, (2, COUNT))
    cos_i, cos_o = 10.0 ** random.uniform(-2, 0, (2, COUNT))
    thickness = 10.0 ** random.uniform(-3, 0.5, COUNT)
    # A tenth of the rows have light and viewer alike, where f_t is a limit.
    alike = slice(COUNT // 10)
    sigma_i[alike], cos_i[alike] = sigma_o[alike], cos_o[alike]
    columns = (density, sigma_i, sigma_o, cos_i, cos_o, thickness)
    return [column.astype(np.float32) for column in columns]


@pytest.mark.parametrize("name", ["reflection", "transmission"])
def test_reflection_and_transmission(name):
    """Some ten roundings of 6e-8; those of an exponent count as often as it says, up to 25 where exp is not dark."""
    columns = drawn(1)
    quarter = np.float32(0.25)
    function, oracle = getattr(slab_float32, name), getattr(slab, name)
    rows = zip(*columns, strict=True)
    found = np.array([function(density * quarter, np.float32(1.0), *row) for density, *row in rows])
    wide = [column.astype(np.float64) for column in columns]
    expected = np.array([oracle(*row) * row[3] * row[4] for row in zip(*wide, strict=True)])
    clear = expected > np.exp(-25.0) * wide[0] * wide[5]
    assert clear.mean() > 0.5
    np.testing.assert_allclose(found[clear], expected[clear], rtol=2e-5)


def test_unscattered_light_and_a_density_as_a_quotient_and_light_that_arrives_behind_gives_nothing():
    _, _, sigma_o, _, cos_o, thickness = drawn(2)
    found = [slab_float32.unscattered(*row) for row in zip(sigma_o, cos_o, thickness, strict=True)]
    wide = (column.astype(np.float64) for column in (sigma_o, cos_o, thickness))
    expected = np.array([slab.unscattered(*row) for row in zip(*wide, strict=True)])
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-12)
    row = [np.float32(x) for x in (0.7, 0.4, 0.6, 0.3, 0.9)]
    whole = slab_float32.reflection(np.float32(6.0), np.float32(1.0), *row)
    assert slab_float32.reflection(np.float32(1.5), np.float32(0.25), *row) == pytest.approx(whole, rel=1e-6)
    zero, some = np.float32(0.0), np.float32(0.5)
    for cosines in ((zero, some), (some, zero), (zero, zero)):
        for function in (slab_float32.reflection, slab_float32.transmission):
            assert function(some, some, some, some, *cosines, some) == 0.0
