import pytest
from pydantic import ValidationError

from pipeline.training.options import TrainingOptions


@pytest.mark.parametrize(
    "table", [{"steps": 0}, {"batch": 0}, {"learning_rate": -1e-3}, {"device": "tpu"}, {"warm_up": 0.9}, {"epochs": 3}]
)
def test_bad_training_options_are_refused(table):
    with pytest.raises(ValidationError):
        TrainingOptions.model_validate(table)
