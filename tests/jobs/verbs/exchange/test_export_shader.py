"""`twillight export --shader` on the command line: what it writes without a compiler, and what it refuses."""

import json
import shutil

import pytest

from pipeline.fingerprint import IDENTITY
from pipeline.models.card import write_model
from pipeline.models.selvage import SelvageOptions
from pipeline.models.selvage.model import Selvage, SelvageNetwork
from pipeline.models.woven import WovenOptions
from pipeline.shader import export_shader as verb
from pipeline.shader import languages, soft_nodes, tables
from tests.pipeline.shader.conftest import CLOTH, neumip_folder
from weaves.fabric import load_fabric


def test_the_source_needs_no_compiler(twillight, monkeypatch, tmp_path):
    monkeypatch.setattr(languages, "find_spec", lambda name: None)
    monkeypatch.setattr(shutil, "which", lambda name: None)
    code, said, complaint = twillight("export", "gingham", "--shader", "out", "--level", "1")
    assert code == 0 and "slang; level 1" in said
    assert json.loads((tmp_path / "out" / "soft_nodes.json").read_text())["languages"] == {}
    complaint = refused(twillight, "gingham", "--shader", "out", "--language", "wgsl")
    assert "slangc is needed: pip install --no-deps slangtorch" in complaint


def refused(twillight, *tokens):
    """Return the one sentence of a refusal."""
    code, _, complaint = twillight("export", *tokens)
    assert code == 2 and complaint.count("\n") == 1
    return complaint


def test_too_many_nodes_cells_and_horizons_are_refused(twillight, monkeypatch, tmp_path):
    complaint = refused(twillight, "crepe", "--shader", "x", "--level", "8")
    assert "1,856 nodes" in complaint and "at most 1,024; choose a lower level" in complaint
    monkeypatch.setattr(tables, "MOST_HEIGHT", 16)
    assert "horizons" in refused(twillight, "gingham", "--shader", "x")
    monkeypatch.setattr(tables, "MOST_REPEAT_CELLS", 3)
    monkeypatch.setattr(soft_nodes, "tabulate_sides", None)  # cells are counted before any work
    assert "at most 3 cells" in refused(twillight, "gingham", "--shader", "x") and not list(tmp_path.iterdir())


def test_models_that_cannot_be_exported_are_refused_in_a_sentence(twillight, monkeypatch, tmp_path):
    neumip = neumip_folder(tmp_path / "neumip", load_fabric(CLOTH), texels_per_yarn=2)
    shader = ("--shader", "x", "--model")
    assert "was not trained on denim" in refused(twillight, "denim", *shader, neumip)
    old = neumip_folder(tmp_path / "old", load_fabric(CLOTH), version=99, texels_per_yarn=2)
    assert "version = 99" in refused(twillight, CLOTH, *shader, old)
    damaged = neumip_folder(tmp_path / "damaged", load_fabric(CLOTH), texels_per_yarn=2)
    (tmp_path / "damaged" / "model.safetensors").write_bytes(b"\0")
    assert "damaged" in refused(twillight, CLOTH, *shader, damaged)
    assert "has no soft nodes" in refused(twillight, CLOTH, *shader, neumip, "--level", "4")
    options = WovenOptions().model_dump(mode="json", context=IDENTITY)
    write_model(tmp_path / "woven", b"", {"options": options, "version": {"model": 1}})
    refused(twillight, CLOTH, *shader, str(tmp_path / "woven"))
    monkeypatch.setattr(verb, "no_onnx", lambda: "not installed: onnxscript")
    assert "not installed: onnxscript" in refused(twillight, CLOTH, *shader, "selvage", "--language", "onnx")
    monkeypatch.setattr(verb, "covering_model", lambda *_: object())
    assert "has no shader; soft_nodes, selvage and" in refused(twillight, CLOTH, *shader, "woven")
    rays = Selvage(SelvageNetwork(SelvageOptions(parallax=True)))
    monkeypatch.setattr(verb, "covering_model", lambda *_: rays)
    assert "was trained with parallax" in refused(twillight, CLOTH, *shader, "rays")
    assert not (tmp_path / "x").exists()


@pytest.mark.slow
def test_a_fabric_unlike_the_training_is_named(twillight, tmp_path):
    code, said, _ = twillight("export", "gauze", "--shader", "out", "--model", "selvage")
    assert code == 0 and "gauze is not like its training: optical_thickness = 2.5" in said
    network = json.loads((tmp_path / "out" / "selvage.json").read_text())["network"]
    assert network["outside"] == "optical_thickness = 2.5" and network["trained_on"]["optical_thickness"] == [2.0, 2.0]
