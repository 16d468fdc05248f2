from pipeline.models.card import write_model
from pipeline.models.registry import load_model, module_of
from tests.refusals import refusal


def test_unknown_models_are_bad_input(tmp_path):
    assert "did you mean 'neumip'" in refusal(module_of, "neumipp")
    write_model(tmp_path, b"", {"options": {"model": "wovenn"}, "version": {"model": 1}})
    assert "options" in refusal(load_model, tmp_path)
