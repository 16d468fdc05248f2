import pytest
import safetensors.torch
import torch

from pipeline.fingerprint import IDENTITY
from pipeline.models.card import write_model
from pipeline.models.neumip import NeumipOptions
from pipeline.models.registry import load_methods, load_model, module_of
from pipeline.models.woven import WovenOptions
from weaves.errors import BadInput


def card_of(options, version=1):
    return {"options": options.model_dump(mode="json", context=IDENTITY), "version": {"model": version}}


def test_an_unknown_model_names_the_nearest():
    with pytest.raises(BadInput, match="did you mean 'neumip'"):
        module_of("neumipp")


def test_options_of_no_model_are_bad_input(tmp_path):
    write_model(tmp_path, b"", {"options": {"model": "wovenn"}})
    with pytest.raises(BadInput, match="options"):
        load_model(tmp_path)


def test_files_of_weights_that_are_none_are_bad_input(tmp_path):
    write_model(tmp_path, b"\0" * 16, card_of(WovenOptions()))
    with pytest.raises(BadInput, match=r"model\.safetensors"):
        load_model(tmp_path)
    write_model(tmp_path, safetensors.torch.save({"a": torch.zeros(2)}), card_of(WovenOptions()))
    with pytest.raises(BadInput, match="do not fit together"):
        load_model(tmp_path)


def test_other_options_or_versions_than_the_trained_ones_are_bad_input(tmp_path):
    write_model(tmp_path, b"", card_of(NeumipOptions(hidden=16)))
    with pytest.raises(BadInput, match="other options"):
        load_methods(NeumipOptions(), [tmp_path])
    write_model(tmp_path, b"", card_of(NeumipOptions(), version=99))
    with pytest.raises(BadInput, match="version = 99"):
        load_methods(NeumipOptions(), [tmp_path])
