"""Light straight through: the truth's own transparency, and a geometry that is found again."""

import numpy as np
import pytest

from pipeline.bsdf.klems import KLEMS_FULL
from pipeline.fitting.fitted import cloth
from pipeline.fitting.straight import (
    Straight,
    fit_geometry,
    gap_rays,
    geometry_numbers,
    images,
    middles,
    straight_share,
)
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries


@pytest.mark.parametrize("draft", ["plain", "twill 2/2"])
def test_the_share_is_the_transparency_of_the_truth(draft):
    """Opaque yarns, light from ten patches: the mean of a direction and its mirror image, within 4 standard errors."""
    fabric = cloth(draft, (0.6, 0.8), (30.0, 20.0), (0.5, 0.4)).model_copy(update={"optical_thickness": 50.0})
    patches = np.random.default_rng(1).choice(np.arange(1, 100), 10, replace=False)
    label = KLEMS_FULL.directions(patches, *middles(patches))
    wo = np.concatenate([label, label * [1.0, -1.0, 1.0]])
    queries = Queries.round(*np.zeros((2, 20)), np.full(20, 32.0), np.tile([0.0, 0.0, 1.0], (20, 1)), wo)
    truth = estimate(fabric, queries, TruthOptions(estimator="owen"), 0)
    mean = truth.transparency.reshape(2, 10).mean(axis=0)
    error = np.hypot(*truth.transparency_standard_error.reshape(2, 10)) / 2.0
    points = 4096
    share = straight_share(fabric, gap_rays(KLEMS_FULL, patches, points), 10)
    gap = 0.4 * 0.2
    error = np.hypot(error, np.sqrt(share * (gap - share) / points))
    assert (np.abs(share - mean) < 4.0 * error + 1e-4).all()


def test_a_patch_has_its_mirror_images():
    label = KLEMS_FULL.directions(np.arange(145), *np.full((2, 145), 0.5))
    for patch in (0, 4, 60, 144):
        same = label[images(KLEMS_FULL, patch)]
        assert np.abs(same[:, :2]) == pytest.approx(np.tile(np.abs(label[patch, :2]), (len(same), 1)), abs=1e-12)
    assert [len(images(KLEMS_FULL, patch)) for patch in (0, 9, 10)] == [1, 2, 4]


@pytest.mark.slow
def test_a_geometry_is_found_again():
    """Shares of a known cloth with an error of 2 %: what they determine is within the stated intervals."""
    known = cloth("plain", (0.7, 0.85), (30.0, 15.0), (0.6, 0.3))
    patches = np.array([p for p in range(1, 133) if images(KLEMS_FULL, p)[0] == p])
    share = straight_share(known, gap_rays(KLEMS_FULL, patches, 2048), len(patches))
    share *= 1.0 + 0.02 * np.random.default_rng(2).standard_normal(len(patches))
    straight = Straight(patches, share, np.ones(len(patches)))
    geometry = fit_geometry(KLEMS_FULL, straight, "plain")
    assert geometry.error < 0.1
    numbers = geometry_numbers(geometry, len(patches))
    truth = {"openness": 0.3 * 0.15, "warp.width": 0.7, "weft.width": 0.85, "weft.relief": 0.3}
    for key, value in truth.items():
        assert numbers[key].low <= value <= numbers[key].high
        assert numbers[key].high < 2.0 * max(numbers[key].low, 0.05)
