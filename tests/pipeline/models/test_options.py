import subprocess
import sys
from importlib.util import find_spec

import pytest
from pydantic import TypeAdapter, ValidationError

from pipeline.models.catalogue import CLASSES, ModelOptions
from pipeline.models.neumip.options import NeumipOptions
from pipeline.models.point_sampled.options import PointSampledOptions
from pipeline.models.woven.options import WovenOptions

MODEL = TypeAdapter(ModelOptions)


def test_model_tells_the_options_apart():
    kinds = {"woven": WovenOptions, "neumip": NeumipOptions, "point_sampled": PointSampledOptions}
    for model, kind in kinds.items():
        assert type(MODEL.validate_python({"model": model})) is kind


@pytest.mark.parametrize("model", CLASSES)
def test_options_lie_in_the_file_of_their_model(model):
    assert CLASSES[model].__module__ == f"pipeline.models.{model}.options"
    assert find_spec(f"pipeline.models.{model}.model") is not None


@pytest.mark.parametrize(
    "table",
    [
        {"model": "wovenn"},
        {"model": "woven", "latnet": 64},
        {"model": "woven", "log_k": 0},
        {"model": "woven", "log_k": float("nan")},
        {"model": "woven", "specular_weight": 0, "diffuse_weight": 0},
        {"model": "woven", "map_texels": 65},
        {"model": "woven", "latent": 3},
        {"model": "woven", "spatial_fusion": False},
        {"model": "woven", "name": "../woven"},
        {"model": "neumip", "texels_per_yarn": 0},
        {"model": "neumip", "blur_halving": 0},
        {"model": "point_sampled", "counts": []},
        {"model": "point_sampled", "counts": [2, 0]},
        {"model": "point_sampled", "footprint": "disc"},
    ],
)
def test_bad_model_options_are_refused(table):
    with pytest.raises(ValidationError):
        MODEL.validate_python(table)


def test_options_need_no_heavy_library():
    code = "import sys, pipeline.models.options, pipeline.training.options; print('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "False\n"
