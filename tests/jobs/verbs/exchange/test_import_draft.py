"""`twillight import` and `export --wif`: the files, what is printed, and the sentences for what cannot be used."""

from tests.weaves.draft_files.drafts import numbered, wif
from weaves.fabric import load_fabric


def test_a_draft_becomes_a_fabric_that_other_verbs_load(twillight, tmp_path):
    (tmp_path / "Scarf #2.wif").write_text(wif(WARP_COLORS=numbered([1, 2] * 4)), encoding="utf-8")
    code, text, complaint = twillight("import", "Scarf #2.wif", "--out", "deep/scarf.toml", "--like", "denim")
    assert (code, complaint) == (0, "")
    assert "it repeats after 4 ends and 4 picks" in text and "Assumed:" in text and "bend 12° and 38°" in text
    fabric = load_fabric(tmp_path / "deep" / "scarf.toml")
    assert fabric.name == "Scarf_2" and fabric.warp.bend == load_fabric("denim").warp.bend
    code, text, _ = twillight("show", "deep/scarf.toml")
    assert code == 0 and "4 ends × 4 picks" in text


def test_options_replace_numbers_of_single_yarns(twillight, tmp_path):
    (tmp_path / "a.wif").write_text(wif(), encoding="utf-8")
    options = ["--warp.bend", "7", "--weft.width", "0.6", "--weft.roughness", "0.2", "--name", "own"]
    assert twillight("import", "a.wif", "--out", "a.toml", *options)[0] == 0
    fabric = load_fabric(tmp_path / "a.toml")
    like = load_fabric("cotton_twill")
    assert (fabric.name, fabric.warp.bend, fabric.weft.width, fabric.weft.roughness) == ("own", 7, 0.6, 0.2)
    assert (fabric.weft.bend, fabric.warp.roughness) == (like.weft.bend, like.warp.roughness)


def test_a_fabric_that_was_exported_is_imported(twillight, tmp_path):
    code, text, _ = twillight("export", "herringbone", "--wif", "h.wif")
    assert code == 0 and "h.wif" in text and "no spacing" in text
    assert twillight("import", "h.wif", "--out", "h.toml", "--like", "herringbone")[0] == 0
    first, again = load_fabric("herringbone"), load_fabric(tmp_path / "h.toml")
    assert again.weave == first.weave and again.optics() == first.optics()
