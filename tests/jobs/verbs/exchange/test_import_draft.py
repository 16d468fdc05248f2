"""`twillight import` and `export --wif`: the files, what is printed, and the sentences for what cannot be used."""

import pytest

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


@pytest.mark.parametrize(
    ("tokens", "said"),
    [
        (["import", "nothing.wif", "--out", "b.toml"], "nothing.wif: no such file"),
        (["import", "a.jpg", "--out", "b.toml"], "its name must end in .wif"),
        (["import", "a.wif", "--out", "b.txt"], "a path that ends in .toml is needed"),
        (["import", "a.wif", "--out", "b.toml", "--like", "denin"], "did you mean 'denim'"),
        (["import", "a.wif", "--out", "b.toml", "--name", "Ü"], "a name has 1 to 60 letters"),
        (["import", "a.wif", "--out", "b.toml", "--warp.bend", "95"], "warp.bend = 95"),
        (["import", "a.wif", "--out", "b.toml", "--warp.twist", "nan"], "warp.twist = nan"),
        (["import", "bad.wif", "--out", "b.toml"], "[THREADING] is missing"),
        (["import", "a.wif", "--out", "a.wif/b.toml"], "a folder that can be written is needed"),
        (["import", "a.wif"], "--out"),
        (["export", "denim", "--wif", "b.txt"], "a path that ends in .wif is needed"),
        (["export", "denim", "--wif", "b.wif", "--repeats", "2"], "--repeats = 2: is not for wif; leave it out"),
    ],
)
def test_bad_input_is_one_sentence(twillight, tmp_path, tokens, said):
    (tmp_path / "a.wif").write_text(wif(), encoding="utf-8")
    (tmp_path / "bad.wif").write_text(wif(THREADING=None), encoding="utf-8")
    code, text, complaint = twillight(*tokens)
    assert code == 2 and text == "" and said in complaint
    assert complaint.count("\n") == 1 and "Traceback" not in complaint
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.wif", "bad.wif"]
