import json

import numpy as np
import pytest

from pipeline.models.registry import load_model, pretrained_folder, pretrained_names
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from reports.measure.furnace import measure_furnace
from weaves.fabric import load_fabric

COLOUR = np.array([0.3, 0.3, 0.5, 0.5])


@pytest.mark.parametrize("name", pretrained_names())
def test_a_model_that_comes_with_the_package(name):
    """At most 5 MB; colour RMSE on fresh queries of a seen and an unseen draft; no light made.

    400 queries of footprints from .3 yarn on, where single queries do not decide: 4 % seen, 6 % unseen.
    """
    folder = pretrained_folder(name)
    assert sum(path.stat().st_size for path in folder.iterdir()) < 5e6
    card = json.loads((folder / "card.json").read_text())
    assert card["name"] == name and card["dataset"]["name"] == "pretrained"
    (method,) = load_model(folder)
    for fabric, limit in ((load_fabric("denim"), 0.04), (load_fabric("twill_4_4"), 0.06)):
        method.domain.refuse_fabric(fabric, name)
        queries = draw_queries(QueryOptions(sigma=(0.3, 8.0), max_angle=80.0), fabric.weave.repeat, 991, 0, 400)
        truth = estimate(fabric, queries, TruthOptions(relative_error=0.01), 1).mean @ COLOUR
        error = method.predict(fabric, queries) @ COLOUR - truth
        assert np.sqrt(np.mean(error**2)) < limit * truth.mean()
        assert max(record.value for record in measure_furnace(method, fabric)) < 1.005
