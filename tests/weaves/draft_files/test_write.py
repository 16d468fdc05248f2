import re

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from tests.refusals import refusal
from weaves.colour import encoded
from weaves.draft import Draft, smallest_repeat
from weaves.draft_files.read import read_draft
from weaves.draft_files.to_fabric import fabric_of
from weaves.draft_files.write import wif_text
from weaves.fabric import Fabric, load_fabric
from weaves.validation import validated

denim = load_fabric("denim")
PALETTE = {"a": {"diffuse": "#102030"}, "b": {"diffuse": "#e88000"}, "c": {"diffuse": [0.5, 0.25, 0.125]}}


@pytest.fixture
def again(tmp_path):
    def call(fabric):
        path = tmp_path / "cloth.wif"
        path.write_text(wif_text(fabric), encoding="utf-8", newline="")
        return fabric_of(read_draft(path), fabric, fabric.name, "cloth.wif", {"warp": {}, "weft": {}}).fabric

    return call


def levels(fabric):
    return [np.rint(255 * encoded(threads.diffuse)).astype(int) for threads in fabric.thread_colours()]


def assert_same_cloth(fabric, found):
    assert found.weave.rows() == Draft(smallest_repeat(fabric.weave.warp_over)).rows()
    for ours, read in zip(levels(fabric), levels(found), strict=True):
        size = np.lcm(len(ours), len(read))
        assert np.array_equal(np.resize(ours, (size, 3)), np.resize(read, (size, 3)))
    # Lengths have three decimals of a decipoint, yarns per centimetre four digits.
    for ours, read in ((fabric.warp, found.warp), (fabric.weft, found.weft)):
        assert read.optics() == ours.optics() | {"width": pytest.approx(ours.width, abs=1e-3)}
    size = fabric.yarns_per_cm
    rounded = size and 0.0005 * max(size) / (720 / 2.54) + 0.0005
    assert found.yarns_per_cm == (size and pytest.approx(size, rel=rounded))


runs = st.lists(st.tuples(st.sampled_from(["a", "b", "c"]), st.integers(1, 6)), max_size=5)
matrices = st.integers(2, 12).flatmap(
    lambda ends: st.lists(st.lists(st.booleans(), min_size=ends, max_size=ends), min_size=2, max_size=12)
)


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(matrices, runs, runs, st.none() | st.tuples(st.floats(1, 90), st.floats(1, 90)), st.floats(0.1, 1.0))
def test_any_cloth_reads_back(again, matrix, ends, picks, size, width):
    over = np.array(matrix)
    assume(over.any(0).all() and over.any(1).all() and (~over).any(0).all() and (~over).any(1).all())
    table = denim.model_dump() | {"draft": {"family": "matrix", "rows": Draft(over).rows()}}
    table["weft"] |= {"width": width}
    table |= {"colours": {"palette": PALETTE, "ends": ends, "picks": picks}, "name": "cloth"}
    table |= {"yarns_per_cm": tuple(float(f"{yarns:.3g}") for yarns in size)} if size else {}
    fabric = validated(Fabric, table, "cloth")
    assert_same_cloth(fabric, again(fabric))


def test_the_file_is_as_other_programs_want_it_and_colours_that_never_fit_are_refused():
    text = wif_text(denim.model_copy(update={"yarns_per_cm": (24.0, 20.0)}))
    parts = re.split(r"^\[(.+)\]\n", text, flags=re.M)
    found = dict(zip(parts[1::2], parts[2::2], strict=True))
    assert "Date=April 20, 1997\nDevelopers=wif@mhsoft.com\n" in found["WIF"]
    assert not re.search(r"^[^=\n]+(?: =|= )", text, re.M)
    assert found["THREADING"].split() == found["TREADLING"].split() == ["1=1", "2=2", "3=3", "4=4"]
    assert found["TIEUP"].split() == ["1=1,3,4", "2=1,2,4", "3=1,2,3", "4=2,3,4"]
    assert f"Spacing={720 / 2.54 / 24:.3f}\nThickness={720 / 2.54 / 24:.3f}\nUnits=Decipoints" in found["WARP"]
    assert "Rising Shed=true" in found["WEAVING"] and "Shafts=4" in found["WEAVING"]
    colours = {"palette": PALETTE, "ends": [["a", 1], ["b", 1400]]}
    fabric = validated(Fabric, denim.model_dump() | {"colours": colours}, "cloth")
    assert "5,604 ends: at most 4,096" in refusal(wif_text, fabric)
