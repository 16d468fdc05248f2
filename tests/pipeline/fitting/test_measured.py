"""The shipped shade has the numbers that its laboratory states."""

import numpy as np
import pytest

from pipeline.bsdf.files import read_bsdf
from pipeline.bsdf.klems import KLEMS_FULL
from pipeline.fitting.measured import SHADE


def test_the_measured_shade_has_the_laboratory_s_numbers():
    """Numbers of pipeline/fitting/measured/README.md: reflectances, light straight through, rings that are known."""
    shade = read_bsdf(SHADE)
    assert shade.basis == KLEMS_FULL
    known = np.isfinite(shade.hemispherical("visible")[1, 0])
    assert np.unique(shade.basis.ring[known]).tolist() == [0, 1, 3, 5, 7]
    reflectance, direct = shade.hemispherical("visible")[0], shade.direct("visible")
    ring = shade.basis.ring == 3
    assert reflectance[:, ring].mean(axis=1) == pytest.approx([0.401, 0.2226], abs=1e-3)
    rings = [direct[0, shade.basis.ring == k].mean() for k in (1, 3, 5, 7)]
    assert rings == pytest.approx([0.0125, 0.0115, 0.0041, 0.0007], abs=1e-4)
    # Along one axis nothing is left at 70 degrees, along the other almost half.
    along, across = (direct[0, np.flatnonzero(shade.basis.ring == 7)[k]] for k in (4, 0))
    assert along / direct[0, ring].max() > 0.35 and across < 1e-4
