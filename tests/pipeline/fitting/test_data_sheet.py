"""Data sheets: a fabric that has their numbers, predictions against what sheets state, contradictions, two streams."""

import numpy as np
import pytest

from pipeline.fitting.data_sheet import completed, layer, read_sheet, scattering_of, transmittance_of
from pipeline.fitting.fit_sheet import fit_sheet
from pipeline.fitting.held_out import predicted_transmittances
from pipeline.fitting.measured import SCREENS
from pipeline.scenes.shade import shade
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from tests.presets import slow
from weaves.colour import LUMINANCE
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


@pytest.mark.parametrize("front", [slow(0.3), slow(0.5)])
def test_the_truth_finds_these_shares_in_the_fabric(sheet, front):
    """Light from straight above, in random directions: within 2 %, transmittance within .01. Files have both ways."""
    (fitted,) = fit_sheet(read_sheet(sheet(front=front)), "screen")
    assert fitted.errors["shares"] < 1e-3
    assert (fitted.fabric.warp.diffuse == fitted.fabric.weft.diffuse) == (front == 0.5)  # equal faces
    assert (1.0 - fitted.fabric.warp.width) * (1.0 - fitted.fabric.weft.width) == pytest.approx(0.04)
    random, count, shares = np.random.default_rng(3), 4000, []

    def directions(degrees):
        sine, turn = np.sin(np.radians(degrees)) * np.sqrt(random.random(count)), 2.0 * np.pi * random.random(count)
        return np.stack([sine * np.cos(turn), sine * np.sin(turn), np.sqrt(1.0 - sine**2)], axis=1)

    light, viewer = directions(9.0), directions(89.0)
    for cloth in (fitted.fabric, fitted.fabric.back()):
        for sign in (1.0, -1.0):
            queries = Queries.round(*np.zeros((2, count)), np.full(count, 32.0), light * [1.0, 1.0, sign], viewer)
            values = shade(cloth, estimate(cloth, queries, TruthOptions(), 0).mean, queries) @ LUMINANCE
            shares.append(np.pi * np.mean(values / np.abs(queries.wi[:, 2])))
    assert shares[::2] == pytest.approx([front, 0.5], rel=0.02)
    assert np.mean(shares[1::2]) == pytest.approx(0.06, abs=0.01)


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


def test_second_bands_are_predicted_where_sheets_state_them_and_white_yarns_scatter_like_white_yarns():
    """Products whose two bands are stated: the interval has the stated transmittance, the value is within .02."""
    rows = [row for row in predicted_transmittances(SCREENS) if np.isfinite(row.stated)]
    assert len(rows) == 3
    for row in rows:
        assert row.predicted.low <= row.stated <= row.predicted.high
        assert "Verosol" in row.product or abs(row.predicted.value - row.stated) < 0.02
    # NET 5 % white by the yarns of NET 1 % white: more than NET 1 % white by about the gaps, and no light is made.
    white = read_sheet(SCREENS, "Alkenz 3000 NET 1 % white")
    sheet, remarks = completed(read_sheet(SCREENS, "Alkenz 3000 NET 5 % white"), white)
    assert len(remarks) == 2
    assert white.transmittance + 0.03 < sheet.transmittance < 1.0 - sheet.reflectance


@pytest.mark.parametrize("scattering", [0.3, 2.0, 8.0])
def test_a_layer_that_absorbs_nothing_has_its_closed_form(scattering):
    assert layer(1.0, scattering) == pytest.approx((scattering / (1 + scattering), 1 / (1 + scattering)), rel=1e-4)


@pytest.mark.parametrize("a", [1.001, 1.2, 6.0])
def test_two_layers_are_one_of_both(a):
    """Stokes: T = T1 T2 / (1 - R1 R2), R = R1 + T1^2 R2 / (1 - R1 R2)."""
    (r1, t1), (r2, t2) = layer(a, 0.7), layer(a, 1.9)
    between = 1.0 - r1 * r2
    assert layer(a, 2.6) == pytest.approx((r1 + t1 * t1 * r2 / between, t1 * t2 / between))


@pytest.mark.parametrize(("reflectance", "transmittance"), [(0.845, 0.122), (0.3, 0.5), (0.05, 1e-4)])
def test_a_layer_is_found_again(reflectance, transmittance):
    scattering = scattering_of(reflectance, transmittance)
    assert transmittance_of(reflectance, scattering) == pytest.approx(transmittance, rel=1e-3)


def test_yarns_reflect_at_most_what_white_ones_do():
    assert transmittance_of(0.99, 2.0) == pytest.approx(1.0 / 3.0, rel=1e-4) and transmittance_of(1e-4, 500.0) == 0.0
