"""Fits to made-up data: optics and draft of a known fabric are found again."""

import numpy as np
import pytest

from pipeline.bsdf.klems import BASES, Scattering
from pipeline.bsdf.of_fabric import fabric_bsdf
from pipeline.fitting.fit_bsdf import fit_bsdf
from pipeline.fitting.fitted import cloth
from pipeline.fitting.scattered import Pairs, Scatterer, YarnOptics, fit_optics, optics_numbers, with_colours
from tests.refusals import refusal

QUARTER = BASES["LBNL/Klems Quarter"]
COLOURS = np.array([0.2, 0.1, 0.5, 0.15, 0.1, 0.05])
OPTICS = YarnOptics((0.3, 0.5), 0.7)
EVERYTHING = np.ones(QUARTER.patches, bool)


@pytest.fixture(scope="module")
def geometry():
    return cloth("twill 3/1", (0.8, 0.9), (25.0, 20.0), (0.6, 0.5))


@pytest.mark.slow
def test_optics_are_found_again_from_light_of_all_bounces(geometry):
    """Other viewers within the patches, and 3 % of noise: numbers within their intervals, widened by a tenth."""
    pairs = Pairs(*(index.ravel() for index in np.indices((2, 2, QUARTER.patches, QUARTER.patches))))
    values = Scatterer(geometry, QUARTER, pairs).values(OPTICS, COLOURS)
    values *= 1.0 + 0.03 * np.random.default_rng(4).standard_normal(len(values))
    data = Scattering(QUARTER, {"visible": values.reshape(2, 2, QUARTER.patches, QUARTER.patches)})
    fit = fit_optics(data, "visible", EVERYTHING, geometry)
    colours, numbers = optics_numbers(fit, 6)
    truth = dict(zip(list(numbers), [*OPTICS.roughness, OPTICS.blend, *COLOURS], strict=True))
    for key in ("warp.roughness", "warp.diffuse", "weft.diffuse"):
        assert numbers[key].low - 0.1 * truth[key] <= truth[key] <= numbers[key].high + 0.1 * truth[key]
    assert colours[2:4] == pytest.approx(COLOURS[2:4], rel=0.15)


def test_nothing_known_is_refused():
    data = Scattering(QUARTER, {"visible": np.full((2, 2, QUARTER.patches, QUARTER.patches), np.nan)})
    assert "some directions of the light" in refusal(fit_bsdf, data, "visible", "cloth", lambda share: None)


@pytest.mark.slow
def test_the_draft_of_a_fabric_is_found_in_its_bsdf(geometry):
    """Data by the reference: the draft of four, the openness, and the contrast of the yarns."""
    fabric = with_colours(geometry, COLOURS, OPTICS)
    data = fabric_bsdf(fabric, basis=QUARTER, points=1).scattering
    drafts = ("plain", "twill 2/2", "twill 3/1", "twill 1/3")
    fitted = fit_bsdf(data, "visible", "again", lambda share: None, drafts=drafts)
    assert next(iter(fitted.drafts)) == "twill 3/1"
    assert fitted.numbers["openness"].value == pytest.approx(0.2 * 0.1, rel=0.3)
    assert fitted.errors["reflectance"] < 0.05
    warp, weft = (yarn.diffuse_rgb[0] for yarn in (fitted.fabric.warp, fitted.fabric.weft))
    assert warp == pytest.approx(0.5, rel=0.15) and weft < 0.5 * warp
