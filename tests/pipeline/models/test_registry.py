import pytest
import safetensors.torch
import torch

from pipeline.fingerprint import IDENTITY
from pipeline.models.card import write_model
from pipeline.models.registry import load_methods, load_model, module_of
from pipeline.models.woven import WovenOptions
from tests.refusals import refusal
from weaves.errors import BadInput

WOVEN = WovenOptions().model_dump(mode="json", context=IDENTITY)


def test_unknown_models_and_other_options_than_the_trained_ones_are_bad_input(tmp_path):
    assert "did you mean 'neumip'" in refusal(module_of, "neumipp")
    write_model(tmp_path, b"", {"options": WOVEN, "version": {"model": 1}})
    assert "other options" in refusal(load_methods, WovenOptions(hidden=16), [tmp_path])


@pytest.mark.parametrize(
    ("options", "version", "weights", "refused"),
    [
        ({"model": "wovenn"}, 1, b"", "options"),
        (WOVEN, 1, b"\0" * 16, r"model\.safetensors"),
        (WOVEN, 1, safetensors.torch.save({"a": torch.zeros(2)}), "do not fit together"),
        (WOVEN, 99, b"", "version = 99"),
    ],
)
def test_folders_that_hold_no_model_are_bad_input(tmp_path, options, version, weights, refused):
    write_model(tmp_path, weights, {"options": options, "version": {"model": version}})
    with pytest.raises(BadInput, match=refused):
        load_model(tmp_path)
