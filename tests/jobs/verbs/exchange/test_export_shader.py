import json
import shutil
from functools import partial

import pytest

from pipeline.models.domain import Domain
from pipeline.shader import export_shader as verb
from pipeline.shader import languages, soft_nodes, tables
from tests.pipeline.shader.conftest import CLOTH, neumip_folder
from weaves.fabric import load_fabric


@pytest.fixture
def refusal(refused):
    return partial(refused, "export")


def test_the_source_needs_no_compiler(twillight, refusal, monkeypatch, tmp_path):
    monkeypatch.setattr(languages, "find_spec", lambda name: None)
    monkeypatch.setattr(shutil, "which", lambda name: None)
    code, said, _ = twillight("export", "gingham", "--shader", "out", "--level", "1")
    assert code == 0 and "slang; level 1" in said
    assert json.loads((tmp_path / "out" / "soft_nodes.json").read_text())["languages"] == {}
    complaint = refusal("gingham", "--shader", "out", "--language", "wgsl")
    assert "slangc is needed: pip install --no-deps slangtorch" in complaint


def test_too_many_nodes_cells_and_horizons_are_refused(refusal, monkeypatch, tmp_path):
    complaint = refusal("crepe", "--shader", "x", "--level", "8")
    assert "1,856 nodes" in complaint and "at most 1,024; choose a lower level" in complaint
    monkeypatch.setattr(tables, "MOST_HEIGHT", 16)
    assert "horizons" in refusal("gingham", "--shader", "x")
    monkeypatch.setattr(tables, "MOST_REPEAT_CELLS", 3)
    monkeypatch.setattr(soft_nodes, "tabulate_sides", None)  # cells are counted before any work
    assert "at most 3 cells" in refusal("gingham", "--shader", "x") and not list(tmp_path.iterdir())


def test_models_that_cannot_be_exported_are_refused_in_a_sentence(refusal, monkeypatch, tmp_path):
    neumip = neumip_folder(tmp_path / "neumip", load_fabric(CLOTH), texels_per_yarn=2)
    shader = ("--shader", "x", "--model")
    assert "was not trained on denim" in refusal("denim", *shader, neumip)
    assert "has no soft nodes" in refusal(CLOTH, *shader, neumip, "--level", "4")
    monkeypatch.setattr(verb, "no_onnx", lambda: "not installed: onnxscript")
    assert "not installed: onnxscript" in refusal(CLOTH, *shader, neumip, "--language", "onnx")
    monkeypatch.setattr(verb, "load_model", lambda _: [object()])
    complaint = refusal(CLOTH, *shader, neumip)
    assert "has no shader; soft_nodes and the folders of a trained neumip, curved or woven" in complaint
    assert not (tmp_path / "x").exists()


def test_a_fabric_unlike_the_training_is_named(twillight, tmp_path):
    thin = load_fabric(CLOTH).model_copy(update={"optical_thickness": 2.5})
    folder = neumip_folder(tmp_path / "neumip", thin, domain=Domain.of({}, [load_fabric(CLOTH)]), texels_per_yarn=2)
    (tmp_path / "thin.toml").write_text(thin.to_toml())
    code, said, _ = twillight("export", "thin.toml", "--shader", "out", "--model", folder)
    assert code == 0 and f"{thin.name} is not like its training: optical_thickness = 2.5" in said
    network = json.loads((tmp_path / "out" / "neumip.json").read_text())["network"]
    assert network["outside"] == "optical_thickness = 2.5" and network["trained_on"]["optical_thickness"] == [2.0, 2.0]
