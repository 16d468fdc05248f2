import os

import pytest

from pipeline.scenes import sources
from pipeline.scenes.catalogue import load_scene
from pipeline.scenes.shipped import SHIPPED
from pipeline.scenes.sources import elements, files, worn
from tests.refusals import refusal

XML = """<scene version="3.0.0">
  <bsdf type="diffuse" id="fabric_denim"/>
  <shape type="ply"><string name="filename" value="sheet.ply"/><ref id="fabric_denim"/></shape>
  <shape type="sphere"><bsdf type="diffuse" id="fabric_seat"/></shape>
  <shape type="sphere"><bsdf type="diffuse" id="steel"/></shape>
  <emitter type="envmap"><string name="filename" value="missing.exr"/></emitter>
</scene>"""


def test_cloths_are_those_of_its_bsdfs_files_those_that_are_there_and_one_that_includes_itself_is_read_once(tmp_path):
    (tmp_path / "sofa.xml").write_text(XML)
    (tmp_path / "sofa.toml").write_text('name = "sofa"\nsource = "sofa.xml"\n[cloths.seat]\nfabric = "satin_8"\n')
    scene = load_scene(tmp_path / "sofa.xml")
    assert worn(load_scene(tmp_path / "sofa.toml")) == {"seat": "satin_8", "denim": "denim"}
    assert worn(scene) == {"denim": "denim", "seat": "seat"}
    assert files(scene) == [tmp_path / "sofa.xml"]
    (tmp_path / "sheet.ply").write_bytes(b"ply")
    assert files(scene) == [tmp_path / "sofa.xml", tmp_path / "sheet.ply"]
    (tmp_path / "sofa.xml").write_text(f'<scene>{SHAPE.format("a.ply")}<include filename="sofa.xml"/></scene>')
    assert [element.tag for element in elements(load_scene(tmp_path / "sofa.xml"))].count("shape") == 1
    assert all(worn(scene) and files(scene) == [] and callable(scene.source) for scene in SHIPPED.values())


SHAPE = '<shape type="obj"><string name="filename" value="{}"/></shape>'


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "broken XML"),
        ("<a>" * 40_000 + "</a>" * 40_000, "nested too deeply"),
        ("<scene>" + "<a/>" * 1000 + "</scene>", "too many elements"),
        ('<!DOCTYPE a [<!ENTITY b "cc">]><scene/>', "document type"),
        ('<scene><path value="/etc"/></scene>', "path = '/etc'"),
        (f"<scene>{SHAPE.format('$x')}</scene>", "filename = '$x'"),
        ('<scene><string name="$n" value="pipe"/></scene>', "without parameters"),
        (f"<scene>{SHAPE.format('/dev/zero')}</scene>", "is a device"),
        (f"<scene>{SHAPE.format('.')}</scene>", "is a folder"),
        ('<scene><spectrum name="a" filename="pipe"/></scene>', "is a pipe"),
        ('<scene><include filename="part.xml"/></scene>', "is a pipe"),
    ],
)
def test_a_file_that_mitsuba_would_not_survive_is_one_sentence(tmp_path, monkeypatch, text, words):
    monkeypatch.setattr(sources, "_MOST_ELEMENTS", 1000)
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "part.xml").write_text('<scene><include filename="pipe"/></scene>')
    (tmp_path / "sofa.xml").write_text(text)
    assert words in refusal(files, load_scene(tmp_path / "sofa.xml"))
