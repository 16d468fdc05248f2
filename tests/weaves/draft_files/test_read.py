import io
import zipfile
from importlib.metadata import files
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from tests.refusals import accepted, ends, refusal
from tests.weaves.draft_files.drafts import BALANCED_ROWS, numbered, wif
from weaves.draft import Draft, smallest_repeat
from weaves.draft_files.read import read_draft
from weaves.draft_files.wif_sections import MOST_WIF_BYTES

SAMPLES = {str(path): Path(path.locate()) for path in files("dtx-to-wif") if "test_data" in path.parts}
"""Files that come with the library; its own tests say which are bad."""
VALID = sorted(name for name in SAMPLES if "bad_" not in name)
BAD = sorted(name for name in SAMPLES if "bad_" in name)


@pytest.fixture(autouse=True)
def _ends():
    with ends():
        yield


@pytest.fixture
def read(tmp_path):
    def call(content, suffix=".wif"):
        path = tmp_path / f"draft{suffix}"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_draft(path)

    return call


def rows(draft):
    return Draft(smallest_repeat(draft.warp_over)).rows()


def test_sections_liftplans_several_treadles_and_falling_sheds(read):
    draft = read(wif())
    assert rows(draft) == BALANCED_ROWS and draft.warp_over.shape == (8, 8)
    assert (draft.title, draft.program, draft.remarks) == ("Small cloth", "Loom 2", ())
    assert draft.ends.colours == ("#ffffff",) * 8 and draft.picks.colours == ("#aa1020",) * 8
    assert (draft.ends.width, draft.picks.width) == pytest.approx((0.75, 0.5))
    assert draft.ends.per_cm == pytest.approx(720 / 12 / 2.54) and draft.picks.per_cm == pytest.approx(1 / 0.254)
    lifts = numbered(["1,2", "2,3", "3,4", "4,1"] * 2)
    assert rows(read(wif(TIEUP=None, TREADLING=None, LIFTPLAN=lifts))) == BALANCED_ROWS
    assert rows(read(wif(TIEUP="1=1\n2=2\n3=3\n4=4", TREADLING=lifts))) == BALANCED_ROWS
    falling = read(wif(WEAVING="Rising Shed=false\nShafts=4\nTreadles=4"))
    assert np.array_equal(falling.warp_over, ~read(wif()).warp_over)


@pytest.mark.parametrize(("most", "red"), [(255, "170,16,32"), (999, "666,63,125"), (65535, "43690,4112,8224")])
def test_palettes_of_any_range(read, most, red):
    draft = read(wif(COLOR_PALETTE=f"Range=0,{most}", COLOR_TABLE=f"1={most},{most},{most}\n2={red}"))
    assert (draft.ends.colours[0], draft.picks.colours[0]) == ("#ffffff", "#aa1020")


READ = ("missing_color_table", "color missing", "too many treadles")
"""Samples for a refusal that are read with a remark."""

FROM_ZERO = numbered([pick % 4 for pick in range(8)])

IMPERFECT = {
    "empty items": ({"TIEUP": "1=1,2,\n2=2,,3\n3=,3,4\n4=4,1\n5=\n6=,"}, ["empty items"]),
    "remarks": ({"WEAVING": "Shafts=4 ; four\nTreadles=4", "TIEUP": "1=1,2 ;left\n2=2,3\n3=3,4\n4=4,1"}, []),
    "treadles from 0": ({"TIEUP": "0=1,2\n1=2,3\n2=3,4\n3=4,1", "TREADLING": FROM_ZERO}, ["treadles from 0"]),
    "shafts from 0": ({"TIEUP": "1=0,1\n2=1,2\n3=2,3\n4=3,0", "THREADING": FROM_ZERO}, ["shafts from 0"]),
    "more ends than stated": ({"WARP": "Threads=4\nColor=1"}, ["[WARP] states 4 threads, the draft has 8"]),
    "more picks than stated": ({"WEFT": "Threads=6\nColor=2"}, ["[WEFT] states 6 threads, the draft has 8"]),
    "no palette": ({"COLOR_PALETTE": None}, ["no Range: 0 to 255"]),
    "no colours": ({"COLOR_TABLE": None, "WARP_COLORS": "1=3"}, ["ends are dark"]),
    "no colour of picks": ({"WEFT": "Threads=8"}, ["[WEFT] states no Color: 8 threads from 1 on take the first, 1"]),
    "no colour of some": (
        {"WEFT": "Threads=8", "WEFT_COLORS": "3=2"}, ["[WEFT] states no Color: 7 threads from 1 on take the first, 2"]
    ),
    "a treadle tied to nothing": ({"TREADLING": numbered([1, 2, 3, 4, "1,9", 2, 3, 4])}, ["to treadle 9"]),
}  # fmt: skip
"""What real programs write, and what the remarks on it say."""


@pytest.mark.parametrize("case", IMPERFECT)
def test_imperfect_files_are_the_same_cloth_with_a_remark(read, case):
    change, said = IMPERFECT[case]
    draft = read(wif(**change))
    assert rows(draft) == BALANCED_ROWS and draft.warp_over.shape == (8, 8)
    assert len(draft.remarks) == len(said) and all(s in r for s, r in zip(said, draft.remarks, strict=True))


def test_single_colours_and_lengths_of_threads(read):
    draft = read(
        wif(WARP_COLORS="2=2\n5=\n8=2", WEFT_COLORS="1=1", WARP_SPACING="1=20\n2=4", WARP_THICKNESS="1=5\n2=3\n3=")
    )
    white, red = "#ffffff", "#aa1020"
    assert draft.ends.colours == (white, red, *[white] * 5, red) and draft.picks.colours == (white, *[red] * 7)
    assert draft.ends.width == pytest.approx((5 + 3 + 6 * 9) / (20 + 4 + 6 * 12))


def test_windows_text_with_a_title_in_per_cent_and_lengths_in_centimetres(read):
    yarns = "Threads=8\nColor=1\nSpacing=.212\nThickness=.2438\nUnits="
    text = wif(TEXT="Title=Café 50% laine", WARP=yarns + "centimeters", WEFT=yarns + "Centimeters")
    draft = read(text.replace("\n", "\r\n").encode("cp1252"))
    assert draft.title == "Café 50% laine" and draft.remarks == () and rows(draft) == BALANCED_ROWS
    assert draft.ends.width == pytest.approx(1.15) and draft.ends.per_cm == pytest.approx(4.717, abs=1e-3)


def test_text_before_the_first_section_is_skipped_and_what_cannot_be_used_a_remark(read):
    private = "[PRIVATE PICTURE]\n" + "x" * 100_000 + "\n=\n[NOTES]\n1=100 %\nno number\n"
    text = "\ufeffsaved by a mail program\r\n" + wif() + private + "   [text]\n   title = 20 % wool\n"
    draft = read(text)
    assert rows(draft) == BALANCED_ROWS and draft.title == "20 % wool"
    draft = read(
        wif(WARP="Threads=8\nColor=1\nUnits=Decipoints", WARP_SPACING="1=20", WEFT="Color=2\nSpacing=3\nUnits=ells")
    )
    assert any("[WARP SPACING] is not used" in remark for remark in draft.remarks)
    assert any("'ells'" in remark for remark in draft.remarks)
    assert draft.ends.per_cm is draft.picks.per_cm is draft.ends.width is None
    assert read(wif(WARP="Threads=8\nColor=1\nSpacing=0\nUnits=Inches")).ends.per_cm is None


def test_the_sample_files_of_the_library_are_read_or_refused(read):
    assert {Path(name).suffix for name in VALID} == {".wif", ".dtx", ".wpo", ".twa"}
    assert len(VALID) > 40 and len(BAD) > 20
    for name in VALID:
        draft = read_draft(SAMPLES[name])
        assert draft.warp_over.shape == (len(draft.picks.colours), len(draft.ends.colours)), name
    for name, path in ((name, SAMPLES[name]) for name in BAD):
        if path.suffix == ".wif" and any(case in name for case in READ):
            assert read(path.read_bytes(), path.suffix).remarks
        else:
            refusal(read, path.read_bytes(), path.suffix)


@pytest.mark.parametrize("form", ["liftplan", "multiple treadles", "single treadles"])
def test_all_formats_of_one_draft_agree(form):
    same = [read_draft(SAMPLES[name]) for name in VALID if Path(name).stem == f"two color {form}"]
    assert len(same) == 5  # two of .wif
    assert len({(draft.warp_over.tobytes(), draft.ends.colours, draft.picks.colours) for draft in same}) == 1


def test_a_sinking_shed_of_fiberworks_is_that_of_its_wif():
    stems = {Path(name).stem for name in VALID if "sinking" in name}
    assert len(stems) == 2
    for stem in stems:
        first, second = (read_draft(SAMPLES[name]).warp_over for name in VALID if Path(name).stem == stem)
        rising = next(read_draft(SAMPLES[n]) for n in VALID if Path(n).stem == stem.removesuffix(" sinking shed"))
        assert np.array_equal(first, second) and np.array_equal(first, ~rising.warp_over)


MALFORMED = {
    "no WIF": (wif(WIF=None), "[WIF]"),
    "bare WIF": ("[WIF]", "[THREADING]"),
    "palette of one": (wif(COLOR_PALETTE="Range=255"), "[COLOR PALETTE] range"),
    "falling palette": (wif(COLOR_PALETTE="Range=255,0"), "[COLOR PALETTE] Range"),
    "colour out of range": (wif(COLOR_TABLE="1=256,0,0\n2=0,0,0"), "[COLOR TABLE] 1"),
    "two levels": (wif(COLOR_TABLE="1=25,0\n2=0,0,0"), "[COLOR TABLE] 1"),
    "gap in table": (wif(COLOR_TABLE="1=2,5,0\n3=0,0,0"), "[WEFT] has Color = 2: [COLOR TABLE] has 2 colours, 1 to 3"),
    "no threading": (wif(THREADING=None), "[THREADING]"),
    "empty threading": (wif(THREADING="1=0\n2="), "[THREADING]"),
    "shaft by name": (wif(THREADING="1=one"), "[THREADING] 1"),
    "end 0": (wif(THREADING="0=1"), "[THREADING] 0"),
    "line without key": (wif(THREADING="1=1\n=2\n2=1"), "[THREADING] has the line =2"),
    "no tie-up": (wif(TIEUP=None), "[TIEUP]"),
    "no treadling": (wif(TREADLING=None), "[TREADLING]"),
    "negative shafts": (wif(WEAVING="Shafts=-2"), "[WEAVING] shafts"),
    "spacing nan": (wif(WARP="Threads=8\nColor=1\nSpacing=nan"), "[WARP] spacing"),
    "negative spacing": (wif(WARP_SPACING="1=-1"), "[WARP SPACING] 1"),
    "many threads": (wif(WARP="Threads=2000000000\nColor=1"), "[WARP] threads"),
    "no threads": (wif(WARP="Threads=0\nColor=1"), "[WARP] threads"),
    "many ends": (wif(THREADING="2000000000=1"), "[THREADING] 2000000000"),
    "colour that is not there": (wif(WARP="Threads=8\nColor=7"), "[WARP] has Color = 7"),
    "colour of an end": (wif(WARP_COLORS="3=7"), "[WARP COLORS] 3"),
    "long line": (wif(TIEUP="1=" + "1," * 9000), "[TIEUP] has a line"),
    "long gap": (wif(TEXT=("a" + " " * 8000 + "b\n") * 100, THREADING=None), "[THREADING]"),
    "long number": (wif(THREADING="1=" + "9" * 5000), "[THREADING] 1"),
    "many lines": (wif(THREADING="1=1\n" * 70_000), "lines"),
    "large": ("[WIF]\n" + "x" * MOST_WIF_BYTES, f"{MOST_WIF_BYTES:,}"),
}  # fmt: skip


def archive(**members):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, content in members.items():
            packed.writestr(name.replace("_", "."), content)
    return file.getvalue()


DTX = "@@StartDTX\n@@Imprint\nPCW 4.2.0\n@@Info\n%%ends 2\n"
DTX += "@@Threading\n1 2\n@@Color Palet\n1,2,3\n4,5,6\n@@Tieup\n01\n10\n"

OTHERS = {
    "no archive": (b"[WIF]", ".twa", "TempoWeave"),
    "no draft inside": (archive(readme_txt="hello"), ".twa", "twamain.waf"),
    "bomb": (archive(twamain_waf=b"\0" * 50_000_000), ".twa", "4,194,304"),
    "bad draft inside": (archive(twamain_waf=wif(THREADING=None)), ".twa", "[THREADING]"),
    "short WeavePoint": (b"\x7b\x05\x65" + b"\1" * 60, ".wpo", "WeavePoint"),
    "text": (b"hello", ".dtx", "@@StartDTX"),
    "threading": (DTX.replace("1 2\n", "1 two\n"), ".dtx", "@@threading"),
    "no threading": (DTX.replace("@@Threading\n1 2\n", ""), ".dtx", "@@threading"),
    "no colours": (DTX.replace("@@Color Palet\n1,2,3\n4,5,6\n", ""), ".dtx", "@@color_table"),
    "tie-up": (DTX.replace("01\n10", "01\n1"), ".dtx", "@@tieup"),
    "no treadling": (DTX, ".dtx", "treadling"),
    "many ends": (DTX.replace("ends 2", "ends 2000000000") + "@@Treadling\n1 2\n", ".dtx", "Threads"),
    "many numbers": ("@@StartDTX\n@@Threading\n" + "1 " * 700_000, ".dtx", "letters"),
    "other suffix": (b"", ".jpg", ".wif, .wifw, .dtx, .wpo, .twa"),
}


def test_a_malformed_file_is_one_sentence_that_names_its_section(read):
    cases = {case: (content, ".wif", named) for case, (content, named) in MALFORMED.items()}
    for case, (content, suffix, named) in (cases | OTHERS).items():
        assert named in refusal(read, content, suffix), case


def test_a_fiberworks_file_by_hand_and_a_weavepoint_file_without_yarns_per_inch(read):
    draft = read(DTX + "@@Treadling\n1 2\n", ".dtx")
    assert draft.warp_over.tolist() == [[True, False], [False, True]]
    assert draft.ends.colours == ("#010203",) * 2 and draft.picks.colours == ("#040506",) * 2
    assert [("default" in remark) for remark in draft.remarks] == [True, True]
    content = bytearray(SAMPLES[next(name for name in VALID if name.endswith("two color liftplan.wpo"))].read_bytes())
    content[9] = content[10] = 0
    assert read(bytes(content), ".wpo").ends.per_cm is None


small = st.sampled_from([name for name in VALID if SAMPLES[name].stat().st_size < 20_000])


@settings(max_examples=300, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(small, st.data())
def test_a_damaged_file_is_a_draft_or_one_sentence(read, name, data):
    content = bytearray(SAMPLES[name].read_bytes())
    for place in data.draw(st.lists(st.integers(0, len(content) - 1), max_size=6)):
        content[place] ^= 1 << data.draw(st.integers(0, 7))
    left = data.draw(st.integers(0, len(content)))
    accepted(read, bytes(content[:left] if data.draw(st.booleans()) else content), SAMPLES[name].suffix)


words = st.sampled_from(["[WIF]", "[WARP]", "[TIEUP]", *"=1,%;\n[] \0", "color", "nan"])


@settings(max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(words, max_size=60), st.sampled_from([".wif", ".dtx"]))
@example(["[WIF]", "\n", "[WARP]", "\n", "color", "=", ","], ".wif")
def test_any_words_are_a_draft_or_one_sentence(read, pieces, suffix):
    accepted(read, "".join(pieces), suffix)
