"""Data sheets: a fabric that has their numbers, predictions against what sheets state, contradictions."""

import numpy as np
import pytest

from pipeline.bsdf.klems import BASES
from pipeline.bsdf.of_fabric import fabric_bsdf
from pipeline.fitting.data_sheet import completed, read_sheet
from pipeline.fitting.fit_sheet import fit_sheet
from pipeline.fitting.held_out import predicted_transmittances
from pipeline.fitting.measured import SCREENS
from tests.presets import slow
from weaves.errors import BadInput

SHEET = """
transmittance = 0.10
direct_transmittance = 0.04
reflectance_front = {front}
reflectance_back = 0.5
"""


@pytest.fixture
def sheet(tmp_path):
    def write(text="", front=0.5):
        (tmp_path / "sheet.toml").write_text(SHEET.format(front=front) + text)
        return tmp_path / "sheet.toml"

    return write


@pytest.mark.slow
def test_a_fabric_has_the_shares_of_its_sheet(sheet):
    (fitted,) = fit_sheet(read_sheet(sheet()), "screen")
    assert fitted.errors["shares"] < 1e-3
    fabric = fitted.fabric
    assert fabric.name == "screen" and (1.0 - fabric.warp.width) * (1.0 - fabric.weft.width) == pytest.approx(0.04)
    assert fabric.warp.diffuse == fabric.weft.diffuse
    number = fitted.numbers["warp.diffuse"]
    assert number.low < number.value < number.high


@pytest.mark.parametrize("front", [slow(0.3), slow(0.5)])
def test_the_truth_finds_these_shares_in_the_fabric(sheet, front):
    """The reference computes the fabric's BSDF: reflectances within 5 %, transmittance within .01."""
    (fitted,) = fit_sheet(read_sheet(sheet(front=front)), "screen")
    shares = fabric_bsdf(fitted.fabric, basis=BASES["LBNL/Klems Quarter"]).scattering.hemispherical("visible")[:, :, 0]
    assert shares[0] == pytest.approx([front, 0.5], rel=0.05)
    assert shares[1].mean() == pytest.approx(0.1, abs=0.01)


@pytest.mark.slow
def test_counts_give_widths_and_thickness_reliefs(sheet):
    counts = "sett = [18.0, 20.0]\ntex = [140.0, 115.0]\nthickness = 0.5\n"
    path = sheet(counts)
    # By weaves.count: 4 tex / (1000 pi 1.52 0.6) is the squared diameter in mm.
    widths = [np.sqrt(4.0 * tex / (1e3 * np.pi * 1.52 * 0.6)) * n / 10.0 for tex, n in ((140.0, 18.0), (115.0, 20.0))]
    fabric = fit_sheet(read_sheet(path), "screen")[0].fabric
    assert [fabric.warp.width, fabric.weft.width] == pytest.approx(widths)
    assert fabric.yarns_per_cm == (18.0, 20.0)
    thickness = sum(10.0 * y.width * y.relief / n for y, n in ((fabric.warp, 18.0), (fabric.weft, 20.0)))
    assert thickness == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("draft = 'plane'", "draft = 'plane': did you mean 'plain'"),
        ("openness = 1.5", "openness = 1.5"),
        (
            "solar = { reflectance_front = 0.8, transmittance = 0.4 }",
            "solar.transmittance = 0.4: is 1.2 with the reflectance, above 1",
        ),
        ("solar = { transmittance = 0.4 }", "solar.reflectance_front is missing: it is required"),
        ("openness = 0.6\nsett = [18.0, 20.0]\ntex = [100.0, 80.0]", "openness = 0.6: counts and sett give widths"),
        ("sett = [18.0, 20.0]\nthickness = 50.0", "thickness = 50.0: at this sett it makes yarns of a relief of"),
        ("sett = [80.0, 20.0]\ntex = [100.0, 80.0]", "tex = 100.0: at 80 ends per cm"),
    ],
)
def test_a_sheet_that_contradicts_itself_is_refused_in_one_sentence(sheet, text, sentence):
    with pytest.raises(BadInput, match=sentence):
        fit_sheet(read_sheet(sheet(text)), "screen")


def test_second_bands_are_predicted_where_sheets_state_them():
    """Products whose two bands are stated: the interval has the stated transmittance, the value is within .02."""
    rows = [row for row in predicted_transmittances(SCREENS) if np.isfinite(row.stated)]
    assert len(rows) == 3
    for row in rows:
        assert row.predicted.low <= row.stated <= row.predicted.high
        assert "Verosol" in row.product or abs(row.predicted.value - row.stated) < 0.02


def test_white_yarns_scatter_like_white_yarns():
    """NET 5 % white by the yarns of NET 1 % white: more than NET 1 % white by about the gaps, and no light is made."""
    white = read_sheet(SCREENS, "Alkenz 3000 NET 1 % white")
    sheet, remarks = completed(read_sheet(SCREENS, "Alkenz 3000 NET 5 % white"), white)
    assert len(remarks) == 2
    assert white.transmittance + 0.03 < sheet.transmittance < 1.0 - sheet.reflectance
