"""What a scene is made of, without loading it: equal to what Mitsuba finds."""

from pathlib import Path

from pipeline.scenes.catalogue import load_scene
from pipeline.scenes.shipped import SHIPPED
from pipeline.scenes.sources import files, worn

XML = """<scene version="3.0.0">
  <bsdf type="diffuse" id="fabric_denim"/>
  <shape type="ply"><string name="filename" value="sheet.ply"/><ref id="fabric_denim"/></shape>
  <shape type="sphere"><bsdf type="diffuse" id="fabric_seat"/></shape>
  <shape type="sphere"><bsdf type="diffuse" id="steel"/></shape>
  <emitter type="envmap"><string name="filename" value="missing.exr"/></emitter>
</scene>"""


def test_cloths_of_an_xml_file_are_those_of_its_bsdfs(tmp_path):
    (tmp_path / "sofa.xml").write_text(XML)
    (tmp_path / "sofa.toml").write_text('name = "sofa"\nsource = "sofa.xml"\n[cloths.seat]\nfabric = "satin_8"\n')
    assert worn(load_scene(tmp_path / "sofa.toml")) == {"seat": "satin_8", "denim": "denim"}
    assert worn(load_scene(tmp_path / "sofa.xml")) == {"denim": "denim", "seat": "seat"}


def test_files_that_are_there_are_part_of_a_scene(tmp_path):
    (tmp_path / "sofa.xml").write_text(XML)
    scene = load_scene(tmp_path / "sofa.xml")
    assert files(scene) == [tmp_path / "sofa.xml"]
    (tmp_path / "sheet.ply").write_bytes(b"ply")
    assert files(scene) == [tmp_path / "sofa.xml", tmp_path / "sheet.ply"]


def test_a_file_that_is_no_xml_wears_nothing(tmp_path):
    (tmp_path / "broken.xml").write_text("<scene")
    scene = load_scene(tmp_path / "broken.xml")
    assert worn(scene) == {} and files(scene) == [tmp_path / "broken.xml"]


def test_shipped_scenes_say_all_that_they_wear():
    assert all(worn(scene) and files(scene) == [] for scene in SHIPPED.values())
    assert not any(isinstance(scene.source, Path) for scene in SHIPPED.values())
