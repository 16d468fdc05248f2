import pytest
import torch
from pydantic import TypeAdapter, ValidationError

from pipeline.fingerprint import IDENTITY
from pipeline.models.catalogue import CLASSES, ModelOptions
from pipeline.models.networks.layers import component_error
from pipeline.models.options import ComponentLossOptions

MODEL = TypeAdapter(ModelOptions)


@pytest.mark.parametrize("model", CLASSES)
def test_identities_state_all_choices_of_the_design(model):
    options = CLASSES[model]()
    identity = options.model_dump(mode="json", context=IDENTITY)
    assert set(options.fixed) <= set(identity)
    assert MODEL.validate_python(identity) == options
    for key in options.fixed:
        with pytest.raises(ValidationError, match=key):
            MODEL.validate_python(identity | {key: 0.75})


@pytest.mark.parametrize(
    "table",
    [
        {"model": "woven", "log_k": float("nan")},
        {"model": "neumip", "specular_weight": 0.5},
        {"model": "woven", "map_texels": 65},
        {"model": "woven", "latent": 3},
        {"model": "woven", "spatial_fusion": False},
        {"model": "woven", "name": "../woven"},
        {"model": "point_sampled", "counts": [2, 0]},
        {"model": "map_material", "size": 100},
        {"model": "unified_btf", "samples": 3, "fewest_samples": 4},
    ],
)
def test_bad_model_options_are_refused(table):
    with pytest.raises(ValidationError):
        MODEL.validate_python(table)


def test_errors_are_weighed_by_kind_of_component():
    options = ComponentLossOptions(diffuse_weight=5.0)
    output, target = torch.tensor([[1.0, 0.0, 2.0, 0.0]]), torch.zeros(1, 4)
    assert component_error(output, target, options).item() == pytest.approx(1 / 2 + 5 * 4 / 2)
