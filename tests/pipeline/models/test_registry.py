import json

import pytest

from pipeline.models.catalogue import CLASSES
from pipeline.models.neumip.options import NeumipOptions
from pipeline.models.point_sampled.options import PointSampledOptions
from pipeline.models.registry import load_methods, load_model, module_of
from pipeline.models.woven.options import WovenOptions
from weaves.errors import BadInput


def test_every_model_is_the_folder_of_its_name():
    for model in CLASSES:
        assert module_of(model).__name__ == f"pipeline.models.{model}.model"


def test_an_unknown_model_names_the_nearest():
    with pytest.raises(BadInput, match="did you mean 'neumip'"):
        module_of("neumipp")


def test_point_sampled_gives_one_method_for_each_count():
    methods = load_methods(PointSampledOptions(counts=[1, 4]))
    assert [(method.name, method.setting) for method in methods] == [
        ("point_sampled", "k = 1"),
        ("point_sampled", "k = 4"),
    ]


def test_a_folder_without_a_model_is_bad_input(tmp_path):
    with pytest.raises(BadInput, match=r"card\.json"):
        load_model(tmp_path)
    (tmp_path / "card.json").write_text("{")
    with pytest.raises(BadInput, match="damaged"):
        load_model(tmp_path)
    (tmp_path / "card.json").write_text('{"options": {"model": "wovenn"}}')
    with pytest.raises(BadInput, match="options"):
        load_model(tmp_path)


def test_missing_or_broken_weights_are_bad_input(tmp_path):
    options = WovenOptions()
    (tmp_path / "card.json").write_text(
        json.dumps({"options": options.model_dump(mode="json"), "version": {"model": 1}})
    )
    with pytest.raises(BadInput, match=r"model\.safetensors"):
        load_model(tmp_path)
    (tmp_path / "model.safetensors").write_bytes(b"\0" * 16)
    with pytest.raises(BadInput, match=r"model\.safetensors"):
        load_model(tmp_path)


def test_other_options_than_the_trained_ones_are_bad_input(tmp_path):
    card = {"options": NeumipOptions(hidden=16).model_dump(mode="json")}
    (tmp_path / "card.json").write_text(json.dumps(card))
    with pytest.raises(BadInput, match="other options"):
        load_methods(NeumipOptions(), [tmp_path])
