from pipeline.fingerprint import IDENTITY
from pipeline.models.card import write_model
from pipeline.models.registry import load_methods, load_model, module_of
from pipeline.models.woven import WovenOptions
from tests.refusals import refusal

WOVEN = WovenOptions().model_dump(mode="json", context=IDENTITY)


def test_unknown_models_and_other_options_than_the_trained_ones_are_bad_input(tmp_path):
    assert "did you mean 'neumip'" in refusal(module_of, "neumipp")
    write_model(tmp_path, b"", {"options": WOVEN, "version": {"model": 1}})
    assert "other options" in refusal(load_methods, WovenOptions(hidden=16), [tmp_path])
    write_model(tmp_path, b"", {"options": {"model": "wovenn"}, "version": {"model": 1}})
    assert "options" in refusal(load_model, tmp_path)
