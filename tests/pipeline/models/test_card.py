import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.models.card import CARD, WEIGHTS, read_card, read_weights, write_model
from tests.refusals import refusal
from weaves.errors import BadInput

CONTENT = {"model": "woven", "options": {"hidden": 16, "rate": 1e-3}, "curve": [{"step": 1, "loss": 0.5}], "ü": None}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("model")
    write_model(folder, bytes(range(256)), CONTENT)
    return folder


def test_what_is_written_is_read_and_gives_the_same_bytes_again(folder, tmp_path):
    card = read_card(folder)
    assert read_weights(folder, card) == bytes(range(256))
    assert {key: value for key, value in card.items() if key != "sha256"} == CONTENT
    write_model(tmp_path, bytes(range(256)), card)
    assert (tmp_path / CARD).read_bytes() == (folder / CARD).read_bytes()


@given(st.data())
def test_every_flip_of_a_card_is_refused(folder, tmp_path_factory, data):
    """Each byte by each mask: also those that change nothing that JSON means, such as a space into a tab."""
    whole = (folder / CARD).read_bytes()
    place, mask = data.draw(st.integers(0, len(whole) - 1)), data.draw(st.integers(1, 255))
    damaged = tmp_path_factory.getbasetemp() / "damaged"
    damaged.mkdir(exist_ok=True)
    (damaged / CARD).write_bytes(whole[:place] + bytes([whole[place] ^ mask]) + whole[place + 1 :])
    with pytest.raises(BadInput, match=r"card\.json: (damaged|has no hashes).*train it again"):
        read_card(damaged)


@pytest.mark.parametrize(
    "content", [b"", b"[]", b"7", b"\xff", b"[" * 100_000, b'{"sha256": 3}', b'{"sha256": {}}', b"{}"]
)
def test_what_is_no_card_or_of_an_earlier_version_is_refused(tmp_path, content):
    (tmp_path / CARD).write_bytes(content)
    with pytest.raises(BadInput, match="has no hashes: it is of an earlier version" if content == b"{}" else "damaged"):
        read_card(tmp_path)


def test_missing_files_and_flips_of_weights_are_named(folder, tmp_path):
    assert "card.json: does not exist: train the model first" in refusal(read_card, tmp_path)
    assert "model.safetensors: does not exist: train it again" in refusal(read_weights, tmp_path, read_card(folder))
    (tmp_path / WEIGHTS).write_bytes(bytes([*range(255), 127]))
    with pytest.raises(BadInput, match=r"model\.safetensors: damaged, its SHA-256.*train it again"):
        read_weights(tmp_path, read_card(folder))
