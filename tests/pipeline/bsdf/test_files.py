"""Files of BSDFs: what is written is read, and faults are named in one sentence."""

from xml.etree import ElementTree

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from pipeline.bsdf.files import NAMESPACE, read_bsdf, write_xml
from pipeline.bsdf.klems import BASES, FACES, SCATTERED, Scattering
from tests.refusals import refusal
from weaves.errors import BadInput

FACTS, QUARTER = ("cloth", 0.05, 0.9, 1e-3), BASES["LBNL/Klems Quarter"]


def layer(basis, most=0.5):
    shape = (2, 2, basis.patches, basis.patches)
    return Scattering(basis, {"visible": most / np.pi * np.random.default_rng(5).random(shape)})


@pytest.mark.parametrize("basis", BASES.values())
def test_what_is_written_is_in_the_file_and_is_read_again(basis, tmp_path):
    """Both bands, each with a block a direction, as six digits with labels (-x, y); a visible band stands for both."""
    write_xml(tmp_path / "layer.xml", layer(basis), *FACTS)
    again, wanted = read_bsdf(tmp_path / "layer.xml"), layer(basis).bands["visible"]
    assert again.basis == basis and set(again.bands) == {"visible", "solar"}
    np.testing.assert_allclose(again.bands["visible"], wanted, rtol=1e-5)
    root, count = ElementTree.parse(tmp_path / "layer.xml").getroot(), 0
    for data in root.iter(f"{{{NAMESPACE}}}WavelengthData"):
        text = {part.tag.removeprefix(f"{{{NAMESPACE}}}"): (part.text or "").strip() for part in data.iter()}
        kind, side = text["WavelengthDataDirection"].lower().split()
        values = np.array(text["ScatteringData"].replace(",", " ").split(), float).reshape(basis.patches, -1)
        written = wanted[SCATTERED.index(kind), FACES.index(side)]
        np.testing.assert_allclose(values[basis.mirror][:, basis.mirror], written, rtol=1e-5)
        assert {text["ColumnAngleBasis"], text["RowAngleBasis"]} == {basis.name}
        count += 1
    assert count == 8


def table(**columns):
    rows = {"kind": "reflection", "side": "front", "theta_in": 0.0, "phi_in": 0.0, "theta_out": 18.0, "phi_out": 0.0}
    return pa.table({name: [value] for name, value in (rows | {"value": 0.1} | columns).items()})


@pytest.mark.parametrize(
    ("columns", "sentence"),
    [
        ({"kind": "absorption"}, "kind = 'absorption': must be reflection or transmission"),
        ({"theta_out": 17.0}, "theta_in, phi_in = 'no patch': middles of patches are needed: LBNL/Klems Full"),
        ({"value": "much"}, "type of column value = 'string'"),
        ({"value": float("nan")}, "value = 'not a finite number'"),
        ({"value": 40.0}, "visible = .*: reflectance and transmittance of a direction are at most 1.005 together"),
        ({"value": -1.0}, "visible = -1.0: values of a BSDF are at least 0"),
    ],
)
def test_a_table_that_cannot_be_used_is_refused_in_one_sentence(columns, sentence, tmp_path):
    pq.write_table(table(**columns), tmp_path / "rows.parquet")
    with pytest.raises(BadInput, match=rf"rows\.parquet: {sentence}"):
        read_bsdf(tmp_path / "rows.parquet")


def test_one_row_is_one_pair_and_blocks_that_a_file_lacks_are_not_known(tmp_path):
    pq.write_table(table(), tmp_path / "rows.parquet")
    blocks = read_bsdf(tmp_path / "rows.parquet").bands["visible"]
    assert np.isfinite(blocks).sum() == 1 and blocks.shape == (2, 2, 41, 41)
    write_xml(path := tmp_path / "layer.xml", layer(QUARTER), *FACTS)
    path.write_text(path.read_text().replace("Reflection Back", "Reflection Front"))
    assert np.isnan(read_bsdf(path).bands["visible"][SCATTERED.index("reflection"), FACES.index("back")]).all()


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("LBNL/Klems Quarter</ColumnAngleBasis", "Own</ColumnAngleBasis", "ColumnAngleBasis = 'Own': known"),
        ("Transmission Front", "Transmission", "WavelengthDataDirection = 'Transmission'"),
        ("</WindowElement>", "", "broken XML"),
        ("<ScatteringData>", "<ScatteringData>1, ", "values of ScatteringData = 1682: 41 x 41 are needed"),
        ("<ScatteringData>", "<ScatteringData>much, ", "ScatteringData = "),
    ],
)
def test_an_xml_file_that_cannot_be_used_is_refused_in_one_sentence(old, new, sentence, tmp_path):
    write_xml(path := tmp_path / "layer.xml", layer(QUARTER), *FACTS)
    path.write_text(path.read_text().replace(old, new))
    assert sentence in refusal(read_bsdf, path)
