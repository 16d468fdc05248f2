"""Trained models asked on the command line: what they answer, and what they refuse."""

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import safetensors.torch
import torch

from jobs.cli import main
from pipeline.fingerprint import IDENTITY
from pipeline.models.card import read_card, read_weights, write_model
from pipeline.models.domain import Domain
from pipeline.models.woven import WovenOptions
from pipeline.models.woven.model import Woven, WovenNetwork
from pipeline.shards.queries import QueryOptions, draw_queries
from weaves.fabric import load_fabric

SMALL = WovenOptions(map_texels=16, encoder_channels=4, hidden=16, latent=8)


@pytest.fixture(scope="module")
def network():
    torch.manual_seed(3)
    return WovenNetwork(SMALL).eval()


@pytest.fixture
def folder(network, tmp_path):
    """Return a folder with a model as training leaves it, taught on two fabrics."""
    domain = Domain.of({}, [load_fabric("denim"), load_fabric("silk_charmeuse")])
    card = {
        "model": "woven",
        "version": {"model": 1},
        "options": SMALL.model_dump(mode="json", context=IDENTITY),
        "domain": domain.model_dump(mode="json"),
    }
    write_model(tmp_path / "model", safetensors.torch.save(network.state_dict()), card)
    return tmp_path / "model"


def file_of(queries, path):
    columns = {name: getattr(queries, name) for name in ("u", "v", "sigma")}
    for name in ("wi", "wo"):
        columns |= {f"{name}_{axis}": getattr(queries, name)[:, k] for k, axis in enumerate("xyz")}
    pq.write_table(pa.table(columns), path)
    return str(path)


def asked(**options):
    return draw_queries(QueryOptions(**options), (4, 4), 1, 0, 70)


def test_a_model_answers_and_states_no_error(network, folder, tmp_path):
    out = tmp_path / "result.parquet"
    path = file_of(asked(), tmp_path / "queries.parquet")
    assert main(["evaluate", "denim", path, "--out", str(out), "--model", str(folder)]) == 0
    table = pq.read_table(out)
    components = ("specular_warp", "specular_weft", "diffuse_warp", "diffuse_weft")
    found = np.stack([table[name].to_numpy() for name in components], axis=1)
    np.testing.assert_allclose(found, Woven(network).predict(load_fabric("denim"), asked()), rtol=1e-5, atol=1e-7)
    assert table["specular_warp_standard_error"].null_count == 70
    about = json.loads(table.schema.metadata[b"twillight"])
    assert about["model"] == "woven" and json.loads(about["card"])["model"] == "woven"


@pytest.mark.parametrize(
    ("fabric", "options", "more", "message"),
    [
        ("denim", {"behind": 1.0}, [], "the model woven was trained for light from the viewer's side only"),
        ("gauze", {}, [], "roughness = 0.6: the model woven was trained on"),
        ("denim", {}, ["--model", "selvage", "--frame", "macro"], "--frame = 'macro': leave it out with --model"),
        ("denim", {}, ["--model", "nobody"], "--model = 'nobody': the folder of a trained model or a name is needed"),
    ],
)
def test_what_it_was_not_taught_is_one_sentence(fabric, options, more, message, folder, tmp_path, capsys):
    path = file_of(asked(**options), tmp_path / "queries.parquet")
    out = tmp_path / "result.parquet"
    code = main(["evaluate", fabric, path, "--out", str(out), *(more or ["--model", str(folder)])])
    complaint = capsys.readouterr().err
    assert code == 2 and message in " ".join(complaint.split()), complaint
    assert "Traceback" not in complaint and not out.exists()


def test_rows_it_was_not_taught_are_named_before_anything_is_computed_and_can_be_skipped(folder, tmp_path, capsys):
    """Row 3,000 of 3,001 lies beyond the first run of rows that a thread answers."""
    queries = draw_queries(QueryOptions(), (4, 4), 1, 0, 3001)
    queries.wi[3000] *= np.float32([1, 1, -1])
    path, out = file_of(queries, tmp_path / "queries.parquet"), tmp_path / "result.parquet"
    asked_for = ["evaluate", "denim", path, "--out", str(out), "--model", str(folder)]
    assert main(asked_for) == 2
    complaint = " ".join(capsys.readouterr().err.split())
    assert "row 3000" in complaint and "light from the viewer's side only" in complaint and not out.exists()
    assert main([*asked_for, "--skip-bad"]) == 0
    assert pq.read_table(out)["diffuse_warp"].null_count == 1
    assert "3000" in (tmp_path / "result.bad.csv").read_text()


def test_a_model_of_another_version_is_refused(folder, tmp_path, capsys):
    card = read_card(folder)
    write_model(folder, read_weights(folder, card), card | {"version": {"model": 99}})
    path = file_of(asked(), tmp_path / "queries.parquet")
    assert main(["evaluate", "denim", path, "--out", str(tmp_path / "r.parquet"), "--model", str(folder)]) == 2
    assert "version = 99: this is version 1 of woven" in " ".join(capsys.readouterr().err.split())


def test_weights_that_do_not_fit_the_card_are_refused(folder, tmp_path, capsys):
    write_model(folder, safetensors.torch.save({"a": torch.zeros(2)}), read_card(folder))
    path = file_of(asked(), tmp_path / "queries.parquet")
    assert main(["evaluate", "denim", path, "--out", str(tmp_path / "r.parquet"), "--model", str(folder)]) == 2
    assert "do not fit together" in " ".join(capsys.readouterr().err.split())


def test_it_can_be_asked_beyond_its_yarns(folder, tmp_path):
    path = file_of(asked(), tmp_path / "queries.parquet")
    out = tmp_path / "result.parquet"
    code = main(["evaluate", "gauze", path, "--out", str(out), "--model", str(folder), "--extrapolate"])
    assert code == 0 and pq.read_metadata(out).num_rows == 70


@pytest.mark.parametrize(("name", "content"), [("card.json", b"{"), ("model.safetensors", b"\x80\x04pickle")])
def test_a_damaged_model_is_named(name, content, folder, tmp_path, capsys):
    (folder / name).write_bytes(content)
    path = file_of(asked(), tmp_path / "queries.parquet")
    assert main(["evaluate", "denim", path, "--out", str(tmp_path / "r.parquet"), "--model", str(folder)]) == 2
    assert name in capsys.readouterr().err
