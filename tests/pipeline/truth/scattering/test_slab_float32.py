import numpy as np
import pytest

from pipeline.truth.scattering import slab_float32


def test_a_density_may_be_a_quotient_and_light_that_arrives_behind_gives_nothing():
    """Its numbers are compared with double precision in tests/reports/truth/test_stability.py."""
    row = [np.float32(x) for x in (0.7, 0.4, 0.6, 0.3, 0.9)]
    whole = slab_float32.reflection(np.float32(6.0), np.float32(1.0), *row)
    assert slab_float32.reflection(np.float32(1.5), np.float32(0.25), *row) == pytest.approx(whole, rel=1e-6)
    zero, some = np.float32(0.0), np.float32(0.5)
    for cosines in ((zero, some), (some, zero), (zero, zero)):
        for function in (slab_float32.reflection, slab_float32.transmission):
            assert function(some, some, some, some, *cosines, some) == 0.0
